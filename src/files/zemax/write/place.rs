//! Decentred and tilted surfaces and breaks of the axis, as coordinate breaks.

use super::{ZemaxWriter, number};
use crate::lens::{AxisBreak, Lens, Row};

/// The coordinate breaks around a surface.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct RowBreaks {
    pub(super) before: Vec<CoordinateBreak>,
    pub(super) behind: Vec<CoordinateBreak>,
}

/// A coordinate break: decentre x and y, tilts about x, y and z in degrees, the order, and the gap
/// behind it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CoordinateBreak {
    parameters: [f64; 6],
    gap: f64,
}

/// The numbers that a surface of the lens has in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::files::zemax) struct FileNumbers {
    /// The surface.
    pub(in crate::files::zemax) surface: usize,
    /// The surface or coordinate break in front of its gap.
    pub(in crate::files::zemax) gap: usize,
}

impl RowBreaks {
    fn of(row: &Row) -> Self {
        let Some(pose) = row.pose() else {
            let behind = row.break_after.map(|axis| steps(&axis)).unwrap_or_default();
            return Self { before: Vec::new(), behind };
        };
        let before = match row.break_before {
            Some(axis) if is_own_centred(row) => steps(&axis),
            _ => steps(&AxisBreak::from_pose(&pose)),
        };
        if row.break_before.is_none() && row.break_after.is_none() {
            let ([x, y], [about_x, about_y]) = (row.decenter, row.tilt);
            let parameters = [-x, -y, -about_x, -about_y, 0.0, 1.0];
            return Self { before, behind: vec![CoordinateBreak { parameters, gap: 0.0 }] };
        }
        let behind = match row.break_after {
            Some(axis) if is_own_centred(row) => steps(&axis),
            None if is_own_centred(row) => Vec::new(),
            _ => {
                let axis = row.axis().map_or_else(|| pose.inverse(), |a| pose.inverse().then(&a));
                steps(&AxisBreak::from_pose(&axis))
            }
        };
        Self { before, behind }
    }
}

fn is_own_centred(row: &Row) -> bool {
    row.decenter == [0.0; 2] && row.tilt == [0.0; 2]
}

/// The coordinate breaks of one break: a displacement along the axis is the gap of a first one.
fn steps(axis: &AxisBreak) -> Vec<CoordinateBreak> {
    let AxisBreak { decenter: [x, y, z], tilt: [about_x, about_y, about_z] } = *axis;
    let turned =
        |x, y| CoordinateBreak { parameters: [x, y, about_x, about_y, about_z, 0.0], gap: 0.0 };
    if z == 0.0 {
        return vec![turned(x, y)];
    }
    let along = CoordinateBreak { parameters: [x, y, 0.0, 0.0, 0.0, 0.0], gap: z };
    vec![along, turned(0.0, 0.0)]
}

/// The coordinate breaks of every surface.
pub(super) fn row_breaks(lens: &Lens) -> Vec<RowBreaks> {
    lens.surfaces.iter().map(RowBreaks::of).collect()
}

/// The numbers of every surface in the file, where the object is 0.
pub(super) fn file_numbers(breaks: &[RowBreaks]) -> Vec<FileNumbers> {
    let mut next = 1;
    let numbers = breaks.iter().map(|row| {
        let surface = next + row.before.len();
        let gap = surface + row.behind.len();
        next = gap + 1;
        FileNumbers { surface, gap }
    });
    numbers.collect()
}

impl ZemaxWriter {
    /// The coordinate breaks in front of a surface.
    pub(super) fn breaks_before(&mut self, i: usize) {
        let breaks = self.breaks[i].before.clone();
        let first = self.numbers[i].surface - breaks.len();
        for (k, own) in breaks.into_iter().enumerate() {
            self.coordinate_break(first + k, &own);
            self.surface_line(format!("DISZ {}", number(own.gap)));
        }
    }

    /// The coordinate breaks behind a surface; the last one has the gap of the surface.
    pub(super) fn breaks_behind(&mut self, i: usize) {
        let breaks = self.breaks[i].behind.clone();
        let last = breaks.len().saturating_sub(1);
        for (k, own) in breaks.into_iter().enumerate() {
            self.coordinate_break(self.numbers[i].surface + 1 + k, &own);
            if k == last {
                self.thickness(i, self.lens.surfaces[i].thickness);
            } else {
                self.surface_line(format!("DISZ {}", number(own.gap)));
            }
        }
    }

    fn coordinate_break(&mut self, surface: usize, own: &CoordinateBreak) {
        self.line(format!("SURF {surface}"));
        self.surface_line("TYPE COORDBRK");
        self.surface_line("CURV 0.0 0 0 0 0 \"\"");
        for (parameter, value) in (1..).zip(own.parameters) {
            self.surface_line(format!("PARM {parameter} {}", number(value)));
        }
        self.surface_line("DIAM 0 0 0 0 1 \"\"");
    }
}

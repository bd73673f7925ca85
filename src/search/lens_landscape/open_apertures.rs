//! Opens apertures as far as the lens has room: the start of a search that is to find where light
//! should be vignetted.

use crate::lens::{
    ASPHERE_TERMS, Aperture, Lens, Medium, Parameter, Quantity, Row, Shape, Variable,
};

/// The lens without its diaphragm, with every semi-diameter as large as the neighbouring surfaces,
/// its own sphere and `limit` permit, in mm. Aspheres and mirrors keep their semi-diameters, and
/// surfaces of gradient-index media do not grow, since they are not known to be defined farther
/// out. The stop moves to the smaller surface next to its old position.
///
/// Its light is limited by all semi-diameters.
#[must_use]
pub fn with_open_apertures(lens: &Lens, limit: f64) -> Lens {
    let mut open = lens.clone();
    let stop = open.stop().unwrap_or(0);
    let plane = is_diaphragm(lens, stop);
    if plane {
        remove_diaphragm(&mut open, stop);
    }
    let mut open = with_open_rims(open, limit);
    let rim = |i: usize| open.surfaces[i].semi_diameter.unwrap_or(limit);
    let stop = if plane && rim(stop - 1) <= rim(stop) { stop - 1 } else { stop };
    for (i, row) in open.surfaces.iter_mut().enumerate() {
        row.stop = i == stop;
    }
    let radius = *open.surfaces[stop].semi_diameter.get_or_insert(limit);
    open.aperture = Aperture::StopSemiDiameter(radius);
    open.zoom.iter_mut().for_each(|position| position.aperture = None);
    open
}

/// True if a surface is a plane in one medium with surfaces on both sides.
fn is_diaphragm(lens: &Lens, i: usize) -> bool {
    let row = &lens.surfaces[i];
    let inside = i > 0 && i + 1 < lens.surfaces.len();
    inside
        && row.curvature == 0.0
        && row.asphere.is_empty()
        && row.apertures.is_empty()
        && row.medium == lens.surfaces[i - 1].medium
        && row.medium != Medium::Mirror
        && !matches!(&row.medium, Medium::Grin(gradient) if gradient.is_axial())
}

/// Removes a surface without effect and joins the gaps on both sides.
fn remove_diaphragm(lens: &mut Lens, i: usize) {
    let gap = |lens: &Lens, row: usize| {
        lens.variable(Parameter::new(row, Quantity::Thickness)).map(|v| (v.min, v.max))
    };
    let bounds = (gap(lens, i - 1), gap(lens, i));
    for zoom in 0..lens.zoom.len() {
        let sum = [i - 1, i].map(|row| lens.thickness_at(row, zoom).unwrap_or(0.0));
        lens.set(Parameter::at_zoom(i - 1, Quantity::Thickness, zoom), sum[0] + sum[1]);
    }
    lens.surfaces[i - 1].thickness += lens.surfaces[i].thickness;
    lens.surfaces.remove(i);
    lens.renumber_rows(|row| match row.cmp(&i) {
        std::cmp::Ordering::Less => Some(row),
        std::cmp::Ordering::Equal => None,
        std::cmp::Ordering::Greater => Some(row - 1),
    });
    let joined = Parameter::new(i - 1, Quantity::Thickness);
    lens.variables.retain(|v| v.parameter != joined);
    if let (Some(a), Some(b)) = bounds {
        let add = |a: Option<f64>, b: Option<f64>| Some(a? + b?);
        lens.variables.push(Variable { parameter: joined, min: add(a.0, b.0), max: add(a.1, b.1) });
    }
}

/// The lens with every semi-diameter as large as the neighbouring surfaces, its own sphere and
/// `limit` permit. If the stop is a refracting surface, the aperture follows its semi-diameter; a
/// diaphragm is unchanged.
pub(super) fn with_open_rims(mut lens: Lens, limit: f64) -> Lens {
    let stop = lens.stop().unwrap_or(0);
    let diaphragm = is_diaphragm(&lens, stop).then(|| lens.surfaces[stop].semi_diameter);
    open_rims(&mut lens, limit);
    if let Some(rim) = diaphragm {
        lens.surfaces[stop].semi_diameter = rim;
    } else if let Aperture::StopSemiDiameter(radius) = &mut lens.aperture {
        *radius = lens.surfaces[stop].semi_diameter.unwrap_or(*radius);
    }
    lens
}

fn open_rims(lens: &mut Lens, limit: f64) {
    let fixed = |row: &Row| !row.asphere.is_empty() || row.medium == Medium::Mirror;
    let graded = |row: &Row| matches!(row.medium, Medium::Grin(_));
    let mut behind = false;
    for row in &mut lens.surfaces {
        let face = behind || graded(row);
        behind = graded(row);
        if !fixed(row) {
            let known = row.semi_diameter.filter(|rim| face && *rim < limit);
            row.semi_diameter = Some(known.unwrap_or(limit).min(conic_shape(row).edge()));
        }
    }
    for i in 0..lens.surfaces.len() - 1 {
        let positions = 0..lens.zoom_positions();
        let gaps = positions.map(|zoom| lens.thickness_at(i, zoom).unwrap_or(0.0));
        let gap = gaps.fold(f64::INFINITY, f64::min);
        let meet = contact_height(&lens.surfaces[i], &lens.surfaces[i + 1], gap);
        for row in &mut lens.surfaces[i..=i + 1] {
            if !fixed(row) {
                row.semi_diameter = row.semi_diameter.map(|rim| rim.min(meet));
            }
        }
    }
    let sizes: Vec<Option<f64>> = lens.surfaces.iter().map(|row| row.semi_diameter).collect();
    for variable in &mut lens.variables {
        let size = sizes.get(variable.parameter.surface).copied().flatten();
        if let (Quantity::SemiDiameter, Some(size)) = (variable.parameter.quantity, size) {
            variable.min = variable.min.map(|min| min.min(size));
            variable.max = variable.max.map(|max| max.max(size));
        }
    }
}

/// The form of a surface without the polynomial of an asphere, whose rim is never opened.
fn conic_shape(row: &Row) -> Shape<f64> {
    Shape::simplest(row.curvature, row.conic, [0.0; ASPHERE_TERMS])
}

/// The height at which two surfaces touch; infinity if they do not.
fn contact_height(before: &Row, behind: &Row, gap: f64) -> f64 {
    let [before, behind] = [before, behind].map(conic_shape);
    let end = before.edge().min(behind.edge()).min(FAR);
    let edge_gap = |height: f64| gap + behind.clamped_sag(height) - before.clamped_sag(height);
    if edge_gap(end) >= 0.0 {
        return f64::INFINITY;
    }
    let (mut open, mut shut) = (0.0, end);
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (open + shut);
        *(if edge_gap(middle) > 0.0 { &mut open } else { &mut shut }) = middle;
    }
    open
}

/// The largest height that is considered, in mm.
const FAR: f64 = 1e6;
/// Bisections until a height is known to rounding.
const BISECTIONS: usize = 60;

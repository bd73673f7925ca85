//! Actions on a row: insert, delete, reverse, make it the stop.

use crate::lens::{Edit, Lens, Medium, Row};

/// Something to do with a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RowAction {
    InsertBefore,
    InsertAfter,
    Remove,
    Flip,
    Stop,
}

/// Everything that can be done, in the order in which it is shown.
pub(super) const ALL: [RowAction; 5] = [
    RowAction::InsertBefore,
    RowAction::InsertAfter,
    RowAction::Remove,
    RowAction::Flip,
    RowAction::Stop,
];

impl RowAction {
    /// The text of its button.
    pub(super) const fn title(self) -> &'static str {
        match self {
            Self::InsertBefore => "Insert before",
            Self::InsertAfter => "Insert after",
            Self::Remove => "Delete",
            Self::Flip => "Reverse element",
            Self::Stop => "Make stop",
        }
    }

    /// The explanation of its button.
    pub(super) const fn hint(self) -> &'static str {
        match self {
            Self::InsertBefore => "Insert a plane surface in front of the selected one (Insert)",
            Self::InsertAfter => "Insert a plane surface behind the selected one",
            Self::Remove => "Delete the selected surface and the gap behind it (Delete)",
            Self::Flip => "Reverse the element or cemented group of the selected surface",
            Self::Stop => "Make the selected surface the aperture stop",
        }
    }

    /// The edit that does it; `None` where it makes no sense.
    pub(super) fn edit(self, lens: &Lens, row: usize) -> Option<Edit> {
        match self {
            Self::InsertBefore => Some(insert_edit(lens, row)),
            Self::InsertAfter => Some(insert_edit(lens, row + 1)),
            Self::Remove => Some(Edit::RemoveRow(row)),
            Self::Flip => {
                let (first, last) = lens.element_around(row)?;
                Some(Edit::ReverseRows { first, last })
            }
            Self::Stop => (!lens.surfaces.get(row)?.stop).then_some(Edit::SetStop(row)),
        }
    }
}

/// A plane surface that divides the gap in front of row `at` and leaves the light as it is: its
/// semi-diameter is automatic and clips nothing.
pub(super) fn insert_edit(lens: &Lens, at: usize) -> Edit {
    let before = at.checked_sub(1).and_then(|i| lens.surfaces.get(i));
    let medium = before.map_or(&lens.object_medium, |row| &row.medium);
    let medium = if *medium == Medium::Mirror { Medium::Air } else { medium.clone() };
    Edit::InsertRow { at, row: Row { medium, ..Row::default() } }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files;

    fn double_gauss() -> Lens {
        let bundled = &files::bundled_lenses()[0];
        files::parse(bundled.text.as_bytes(), bundled.name).unwrap().lens
    }

    #[test]
    fn an_element_is_found_from_each_of_its_surfaces() {
        let lens = double_gauss();
        let glass = |row: &Row| !matches!(row.medium, Medium::Air);
        let first = lens.surfaces.iter().position(glass).unwrap();
        let (start, end) = lens.element_around(first).unwrap();
        assert!((start..=end).all(|row| lens.element_around(row) == Some((start, end))));
    }

    #[test]
    fn a_surface_in_air_has_nothing_to_flip() {
        let lens = double_gauss();
        let stop = lens.stop().unwrap();
        let alone = lens.element_around(stop).is_none();
        assert_eq!(RowAction::Flip.edit(&lens, stop).is_none(), alone);
    }

    #[test]
    fn an_inserted_surface_leaves_the_light_as_it_is() {
        let lens = double_gauss();
        let Edit::InsertRow { at: 1, row } = insert_edit(&lens, 1) else { unreachable!() };
        assert_eq!(row.medium, lens.surfaces[0].medium);
        assert_eq!((row.curvature, row.thickness), (0.0, 0.0));
        assert_eq!(row.semi_diameter, None, "it clips nothing");
    }
}

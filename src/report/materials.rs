//! The materials of a lens in words, and the bill of material with weights.

use super::body::LensBody;
use crate::lens::{Medium, glass};
use crate::math::ShortNumber;
use crate::plot::DocumentTable;

/// The name of a material, as drawings and tables have it.
pub(super) fn material_name(medium: &Medium) -> String {
    match medium {
        Medium::Air => String::new(),
        Medium::Mirror => "mirror".to_owned(),
        Medium::Glass(name) => {
            glass::find(name).map_or_else(|| name.clone(), glass::Glass::full_name)
        }
        Medium::Model { nd, vd } => format!("model glass {nd:.5}, {vd:.2}"),
        Medium::Index(n) => format!("index {n}"),
        Medium::Grin(grin) => format!("gradient index on {}", material_name(&grin.base)),
    }
}

/// Index and Abbe number at the d line; `None` where the material has none of its own.
pub(super) fn index_and_abbe(medium: &Medium) -> Option<(f64, Option<f64>)> {
    match medium {
        Medium::Glass(name) => glass::find(name).map(|glass| (glass.nd, Some(glass.vd))),
        Medium::Model { nd, vd } => Some((*nd, (*vd != 0.0).then_some(*vd))),
        Medium::Index(n) => Some((*n, None)),
        Medium::Grin(grin) => index_and_abbe(&grin.base),
        Medium::Air | Medium::Mirror => None,
    }
}

/// The bill of material: a row for each body, and the sum of the weights that are known.
pub(super) fn bill_of_material(bodies: &[LensBody]) -> (DocumentTable, String) {
    let heads = [
        "element",
        "surfaces",
        "material",
        "thickness",
        "diameter",
        "edge",
        "volume, mm\u{b3}",
        "density, g/cm\u{b3}",
        "mass, g",
    ];
    let mut table = DocumentTable::new(&heads, &[0, 1, 2]);
    bodies.iter().for_each(|body| table.row(bill_row(body)));
    (table, weight_text(bodies))
}

fn bill_row(body: &LensBody) -> [String; 9] {
    let is_solid = body.solid().is_ok();
    let solid = |text: String| if is_solid { text } else { "-".to_owned() };
    let unknown = || "unknown".to_owned();
    let mass = body.mass().map_or_else(unknown, |mass| format!("{mass:.3}"));
    [
        body.number.to_string(),
        body.surface_numbers(),
        material_name(&body.medium),
        ShortNumber(body.thickness).to_string(),
        ShortNumber(2.0 * body.rim()).to_string(),
        solid(format!("{:.3}", body.edge_thickness())),
        solid(format!("{:.2}", body.volume())),
        body.density().map_or_else(unknown, |density| format!("{density:.2}")),
        solid(mass),
    ]
}

fn weight_text(bodies: &[LensBody]) -> String {
    let known: Vec<f64> =
        bodies.iter().filter(|body| body.solid().is_ok()).filter_map(LensBody::mass).collect();
    let sum: f64 = known.iter().sum();
    let missing = bodies.len() - known.len();
    if known.is_empty() {
        return "The weight is not known: no element has both a density in the glass catalogue and a \
                volume."
            .to_owned();
    }
    let elements = if missing == 1 { "element" } else { "elements" };
    let left_out = if missing == 0 {
        String::new()
    } else {
        format!(", without {missing} {elements} whose density or volume is not known")
    };
    format!(
        "Weight of the glass: {sum:.3} g{left_out}. Densities are those of the glass catalogue, given \
         there to 0.01 g/cm\u{b3}; volumes are those of solids of revolution with plane rims, without \
         chamfers, in closed form."
    )
}

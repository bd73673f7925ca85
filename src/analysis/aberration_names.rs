//! The names of the aberrations that Zernike polynomials describe.

use super::ZernikeIndex;

/// The names by azimuthal frequency from 0, with the radial degree of the first polynomial that has
/// the name.
const FAMILIES: [(&str, u32); 8] = [
    ("spherical", 4),
    ("coma", 3),
    ("astigmatism", 2),
    ("trefoil", 3),
    ("tetrafoil", 4),
    ("pentafoil", 5),
    ("hexafoil", 6),
    ("heptafoil", 7),
];

/// The prefixes of the polynomials of a family, by increasing radial degree.
const ORDERS: [&str; 4] = ["", "secondary ", "tertiary ", "quaternary "];

/// The name of the aberration of a polynomial.
pub fn aberration_name(index: ZernikeIndex) -> String {
    let frequency = index.frequency.unsigned_abs();
    let direction = direction(index.frequency);
    match (index.degree, frequency) {
        (0, _) => return "piston".to_owned(),
        (1, _) => return format!("tilt{direction}"),
        (2, 0) => return "defocus".to_owned(),
        _ => {}
    }
    let Some((name, first)) = FAMILIES.get(frequency as usize) else {
        return format!("{frequency}-foil{direction}");
    };
    let order = ORDERS.get((index.degree.saturating_sub(*first) / 2) as usize);
    format!("{}{name}{direction}", order.unwrap_or(&"higher-order "))
}

/// The direction of a polynomial: positive frequencies are cosines, negative ones are sines.
fn direction(frequency: i32) -> &'static str {
    match frequency {
        0 => "",
        1 => " x",
        -1 => " y",
        2 => " 0°",
        -2 => " 45°",
        3.. => " cos",
        _ => " sin",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::ZernikeOrder;

    #[test]
    fn the_first_polynomials_have_their_names() {
        let names = |order: ZernikeOrder, numbers: &[usize]| -> Vec<String> {
            let all = order.indices(37);
            numbers.iter().map(|number| aberration_name(all[number - 1])).collect()
        };
        let noll = names(ZernikeOrder::Noll, &[1, 2, 3, 4, 5, 6, 7, 8, 11, 22]);
        let known = [
            "piston",
            "tilt x",
            "tilt y",
            "defocus",
            "astigmatism 45°",
            "astigmatism 0°",
            "coma y",
            "coma x",
            "spherical",
            "secondary spherical",
        ];
        assert_eq!(noll, known);
        let fringe = names(ZernikeOrder::Fringe, &[5, 7, 9, 16, 36]);
        let known = [
            "astigmatism 0°",
            "coma x",
            "spherical",
            "secondary spherical",
            "quaternary spherical",
        ];
        assert_eq!(fringe, known);
    }
}

//! The numbered entities of a STEP file, and the product that every solid is.

use crate::math::Vec3;

/// The accuracy of the file in mm.
const ACCURACY: f64 = 1e-6;

/// The number of an entity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct EntityNumber(usize);

impl std::fmt::Display for EntityNumber {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "#{}", self.0)
    }
}

/// The entities written so far.
#[derive(Debug)]
pub(super) struct StepEntities {
    lines: Vec<String>,
    context: EntityNumber,
    definition: EntityNumber,
    geometry: EntityNumber,
}

impl StepEntities {
    /// The contexts and the units: millimetre and radian.
    pub(super) fn new() -> Self {
        let none = EntityNumber(0);
        let mut own = Self { lines: Vec::new(), context: none, definition: none, geometry: none };
        let application =
            own.add("APPLICATION_CONTEXT('core data for automotive mechanical design processes')");
        own.add(&format!(
            "APPLICATION_PROTOCOL_DEFINITION('international standard','automotive_design',2000,\
             {application})"
        ));
        own.context = own.add(&format!("PRODUCT_CONTEXT('',{application},'mechanical')"));
        own.definition = own
            .add(&format!("PRODUCT_DEFINITION_CONTEXT('part definition',{application},'design')"));
        let length = own.add("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))");
        let angle = own.add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))");
        let solid = own.add("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())");
        let accuracy = own.add(&format!(
            "UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE({}),{length},'distance_accuracy_value','')",
            real(ACCURACY)
        ));
        own.geometry = own.add(&format!(
            "(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT(({accuracy}))\
             GLOBAL_UNIT_ASSIGNED_CONTEXT(({length},{angle},{solid}))REPRESENTATION_CONTEXT('',''))"
        ));
        own
    }

    /// Adds an entity.
    pub(super) fn add(&mut self, text: &str) -> EntityNumber {
        self.lines.push(text.to_owned());
        EntityNumber(self.lines.len())
    }

    pub(super) fn point(&mut self, p: Vec3<f64>) -> EntityNumber {
        self.add(&format!("CARTESIAN_POINT('',({},{},{}))", real(p.x), real(p.y), real(p.z)))
    }

    pub(super) fn direction(&mut self, d: Vec3<f64>) -> EntityNumber {
        self.add(&format!("DIRECTION('',({},{},{}))", real(d.x), real(d.y), real(d.z)))
    }

    /// A frame by its origin, its axis and the direction from which angles count.
    pub(super) fn placement(
        &mut self,
        origin: Vec3<f64>,
        axis: Vec3<f64>,
        reference: Vec3<f64>,
    ) -> EntityNumber {
        let (p, z, x) = (self.point(origin), self.direction(axis), self.direction(reference));
        self.add(&format!("AXIS2_PLACEMENT_3D('',{p},{z},{x})"))
    }

    /// A product with a name, a description and one solid within a closed shell.
    pub(super) fn product(&mut self, name: &str, description: &str, shell: EntityNumber) {
        let (name, description) = (string(name), string(description));
        let brep = self.add(&format!("MANIFOLD_SOLID_BREP({name},{shell})"));
        let [x, z] = [Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 0.0, 1.0)];
        let frame = self.placement(Vec3::new(0.0, 0.0, 0.0), z, x);
        let geometry = self.geometry;
        let shape = self.add(&format!(
            "ADVANCED_BREP_SHAPE_REPRESENTATION({name},({frame},{brep}),{geometry})"
        ));
        let context = self.context;
        let product = self.add(&format!("PRODUCT({name},{name},{description},({context}))"));
        self.add(&format!("PRODUCT_RELATED_PRODUCT_CATEGORY('part',$,({product}))"));
        let formation = self.add(&format!("PRODUCT_DEFINITION_FORMATION('','',{product})"));
        let design = self.definition;
        let definition = self.add(&format!("PRODUCT_DEFINITION('design','',{formation},{design})"));
        let what = self.add(&format!("PRODUCT_DEFINITION_SHAPE('','',{definition})"));
        self.add(&format!("SHAPE_DEFINITION_REPRESENTATION({what},{shape})"));
    }

    /// The whole file. It has no date: the same lens gives the same bytes.
    pub(super) fn into_text(self, name: &str, deviation: f64) -> String {
        let note = format!("optical elements; splines within {deviation:.1e} mm of their surfaces");
        let head = format!(
            "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION(({}),'2;1');\n\
             FILE_NAME({},'1970-01-01T00:00:00',(''),(''),'Aplanat {}','Aplanat','');\n\
             FILE_SCHEMA(('AUTOMOTIVE_DESIGN {{ 1 0 10303 214 1 1 1 1 }}'));\nENDSEC;\nDATA;\n",
            string(&note),
            string(name),
            env!("CARGO_PKG_VERSION")
        );
        let numbered = |(i, line): (usize, &String)| format!("#{}={line};\n", i + 1);
        let lines: String = self.lines.iter().enumerate().map(numbered).collect();
        format!("{head}{lines}ENDSEC;\nEND-ISO-10303-21;\n")
    }
}

/// A real number: it needs a decimal point, even before an exponent.
pub(super) fn real(value: f64) -> String {
    let text = format!("{:E}", value + 0.0);
    match text.split_once('E') {
        Some((digits, exponent)) if !digits.contains('.') => format!("{digits}.E{exponent}"),
        _ => text,
    }
}

/// A string between quotes.
fn string(text: &str) -> String {
    let letters: String = text.chars().map(quoted_letter).collect();
    format!("'{letters}'")
}

/// A letter of a string: quotes and backslashes doubled, other letters than those of ASCII by their code
/// points.
fn quoted_letter(letter: char) -> String {
    match letter {
        '\'' => "''".to_owned(),
        '\\' => "\\\\".to_owned(),
        ' '..='~' => letter.to_string(),
        c if c.is_control() => " ".to_owned(),
        c if u32::from(c) > 0xffff => format!("\\X4\\{:08X}\\X0\\", u32::from(c)),
        c => format!("\\X2\\{:04X}\\X0\\", u32::from(c)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_strings_are_those_of_the_standard() {
        let numbers = [1.0, -0.0, 1e-7, 12.5, -3e20].map(real);
        assert_eq!(numbers, ["1.E0", "0.E0", "1.E-7", "1.25E1", "-3.E20"]);
        assert_eq!(string("a'b\\\u{e9}\n"), "'a''b\\\\\\X2\\00E9\\X0\\ '");
    }
}

//! A complete specification: what was written and, for everything else, the usual.

use super::refusal::check;
use super::{AS_BUILT_GRADES, GlassList, LensSpecification, LensWish, SpecificationError};
use crate::lens::ToleranceGrade;
use crate::lens::glass::{self, line};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Everything that is asked of a lens. Lists by field have as many entries as there are fields.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LensRequirements {
    /// The focal length, in mm; a lens may deviate from it by [`FOCAL_LENGTH_TOLERANCE`]. Of a near object
    /// the height of an image point over the slope at which the first vertex sees its object point: the
    /// magnification times the distance of the object. A beam that is as wide at the first vertex has the same
    /// f-number then, and a field the same image height, as those of a distant object at this focal length.
    pub focal_length: f64,
    /// The near object; `None` for a distant one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub object: Option<NearObject>,
    /// The f-number.
    pub f_number: f64,
    /// The fields in degrees from the axis, ascending from 0.
    pub fields: Vec<f64>,
    /// The wavelengths in micrometres with their weights.
    pub wavelengths: Vec<(f64, f64)>,
    /// The smallest back focus, in mm.
    pub back_focus: f64,
    /// The largest track from the first vertex to the image, in mm.
    pub track: f64,
    /// The largest number of pieces of glass.
    pub elements: usize,
    /// The largest number of aspheric surfaces, conics included.
    pub aspheric_surfaces: usize,
    /// The permitted glasses.
    pub glasses: GlassChoice,
    /// The largest absolute distortion, as a fraction.
    pub distortion: f64,
    /// The smallest relative illumination of every field.
    pub relative_illumination: Vec<f64>,
    /// The smallest clear area of every field, in mm².
    pub clear_area: Vec<f64>,
    /// The largest semi-diameter, in mm.
    pub semi_diameter: f64,
    /// The smallest thickness of glass on the axis, in mm.
    pub glass_center: f64,
    /// The smallest thickness of glass at its rim, in mm.
    pub glass_edge: f64,
    /// The smallest air space on the axis, in mm.
    pub air_center: f64,
    /// The quality that the lens is to excel in.
    #[serde(default)]
    pub wish: LensWish,
    /// The class of care in making for which the lenses are refined at the end; `None` for none.
    #[serde(default = "usual_grade")]
    pub as_built: Option<ToleranceGrade>,
}

/// An object at a finite distance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NearObject {
    /// Its distance in front of the first vertex, in mm.
    pub distance: f64,
    /// The magnification of its real image, below 0.
    pub magnification: f64,
}

/// The usual class of care in making.
#[expect(clippy::unnecessary_wraps, reason = "the value of a key that may be none")]
fn usual_grade() -> Option<ToleranceGrade> {
    Some(ToleranceGrade::Precision)
}

/// The permitted glasses.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GlassChoice {
    /// The glasses of the catalogue by manufacturer and name; empty for all of them.
    pub names: Vec<String>,
    /// The ranges of the index and of the Abbe number of model plastics, if they are permitted.
    pub plastics: Option<[[f64; 2]; 2]>,
}

/// A value that the specification does not state.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FilledValue {
    /// The key.
    pub key: &'static str,
    /// The value that is taken, as text.
    pub value: String,
    /// The reason for it.
    pub reason: &'static str,
}

/// The relative deviation of the focal length that a lens may have.
pub const FOCAL_LENGTH_TOLERANCE: f64 = 0.01;
/// The relative difference between the distance of an object from a first vertex and from a thin lens.
const THICKNESS: f64 = 0.5;
/// The share of the area of an unvignetted beam that has to be clear on the axis.
const CLEAR_ON_AXIS: f64 = 0.98;

impl LensRequirements {
    /// Fills what a specification does not state, and refuses what no lens can do.
    ///
    /// # Errors
    /// A value that is none, and requirements that no lens satisfies.
    pub fn complete(
        spec: &LensSpecification,
    ) -> Result<(Self, Vec<FilledValue>), SpecificationError> {
        check::check_numbers(spec)?;
        let mut fill = Filling::default();
        let (focal_length, object) = fill.scale(spec)?;
        fill.focal_length = focal_length;
        let f_number = fill.f_number(spec)?;
        let fields = fill.fields(spec)?;
        let complete = fill.rest(spec, object, (f_number, fields))?;
        check::check_feasible(spec, &complete)?;
        Ok((complete, fill.filled))
    }

    /// The largest field, in degrees.
    pub fn half_field(&self) -> f64 {
        self.fields.last().copied().unwrap_or(0.0)
    }

    /// The focal length of a thin lens that does what is asked for, in mm.
    pub fn thin_focal_length(&self) -> f64 {
        let nearness = self.object.map_or(0.0, |object| self.focal_length / object.distance);
        self.focal_length / (1.0 + nearness)
    }

    /// The slope at the edge of the first vertex, per mm of it, of a ray from the axial object point.
    pub(super) fn object_slope(&self) -> f64 {
        self.object.map_or(0.0, |object| 1.0 / object.distance)
    }

    /// The radius of the beam on the axis that has the required area, in mm.
    pub fn beam_radius(&self) -> f64 {
        (self.clear_area.first().copied().unwrap_or(0.0) / PI).sqrt()
    }
}

impl GlassChoice {
    /// True if a glass of the catalogue, given by its full name, is permitted.
    pub fn allows(&self, full_name: &str) -> bool {
        self.names.is_empty() || self.names.iter().any(|name| name == full_name)
    }

    /// True if a model plastic is permitted.
    pub fn allows_model(&self, nd: f64, vd: f64) -> bool {
        let inside = |[low, high]: [f64; 2], v: f64| v >= low - 1e-9 && v <= high + 1e-9;
        self.plastics.is_some_and(|[index, abbe]| inside(index, nd) && inside(abbe, vd))
    }

    fn of(list: &GlassList) -> Result<Self, SpecificationError> {
        match list {
            GlassList::Words(words) => Self::of_words(words),
            GlassList::Names(names) => {
                let full = names.iter().map(|name| full_name(name));
                Ok(Self { names: full.collect::<Result<_, _>>()?, plastics: None })
            }
        }
    }

    fn of_words(words: &str) -> Result<Self, SpecificationError> {
        let plastics = || {
            let ranges = words.strip_prefix(ANY_GLASS)?.strip_prefix(" or model plastics nd ")?;
            let (index, abbe) = ranges.split_once(", vd ")?;
            let range = |text: &str| {
                let (low, high) = text.split_once('-')?;
                Some([low.parse().ok()?, high.parse().ok()?])
            };
            Some([range(index)?, range(abbe)?])
        };
        match plastics() {
            None if words != ANY_GLASS => Err(SpecificationError::invalid(
                "glasses",
                format!("`{words}`"),
                "`any glass of the catalogue`, perhaps followed by ` or model plastics nd \
                 1.53-1.67, vd 20-56`, or a list of names",
            )),
            plastics => Ok(Self { names: Vec::new(), plastics }),
        }
    }
}

const ANY_GLASS: &str = "any glass of the catalogue";

fn full_name(name: &str) -> Result<String, SpecificationError> {
    glass::find(name).map(glass::Glass::full_name).ok_or_else(|| {
        let expected = "manufacturer and name of a glass of the catalogue, like SCHOTT N-BK7";
        SpecificationError::invalid("glasses", format!("`{name}`"), expected)
    })
}

/// The values that are filled so far.
#[derive(Debug, Default)]
struct Filling {
    filled: Vec<FilledValue>,
    /// The focal length, or what stands for it with a near object, in mm.
    focal_length: f64,
}

impl Filling {
    /// The value of a key, or the usual one with a note.
    fn or<T: Clone + std::fmt::Debug>(
        &mut self,
        key: &'static str,
        stated: Option<&T>,
        usual: T,
        reason: &'static str,
    ) -> T {
        let Some(value) = stated else {
            self.filled.push(FilledValue { key, value: format!("{usual:?}"), reason });
            return usual;
        };
        value.clone()
    }

    /// The focal length, or what stands for it with a near object, and that object.
    fn scale(
        &mut self,
        spec: &LensSpecification,
    ) -> Result<(f64, Option<NearObject>), SpecificationError> {
        let Some(size) = spec.magnification.map(f64::abs) else {
            let focal = spec.focal_length_mm;
            let focal = focal.ok_or(SpecificationError::Missing("focal_length_mm"))?;
            return match (&spec.object, spec.object_distance_mm) {
                (Some(object), _) if object == "finite" => {
                    Err(SpecificationError::Missing("magnification"))
                }
                (_, Some(_)) => Err(SpecificationError::Missing("magnification")),
                _ => Ok((focal, None)),
            };
        };
        if spec.object.as_deref() == Some("infinity") {
            return Err(SpecificationError::Contradiction(
                "a magnification of an object at infinity; expected a focal length, or `finite`"
                    .to_owned(),
            ));
        }
        let of_thin = spec.focal_length_mm.map(|focal| focal * (1.0 + size) / size);
        let distance = match (spec.object_distance_mm, of_thin) {
            (Some(stated), Some(thin)) if (stated / thin - 1.0).abs() > THICKNESS => {
                return Err(SpecificationError::Contradiction(format!(
                    "an object at {stated} mm; a thin lens of this focal length has this magnification \
                     at {thin:.3} mm"
                )));
            }
            (Some(stated), _) => stated,
            (None, Some(thin)) => {
                let reason = "a thin lens of this focal length and magnification";
                self.or("object_distance_mm", None, thin, reason)
            }
            (None, None) => return Err(SpecificationError::Missing("object_distance_mm")),
        };
        Ok((size * distance, Some(NearObject { distance, magnification: -size })))
    }

    fn f_number(&mut self, spec: &LensSpecification) -> Result<f64, SpecificationError> {
        let focal_length = self.focal_length;
        let of_light = || {
            let area = spec.min_clear_area_mm2.as_ref()?.first()?;
            Some(focal_length / (2.0 * (area / PI).sqrt()))
        };
        let of_aperture = spec.numerical_aperture.map(|na| 0.5 / na);
        if let (Some(_), Some(_)) = (spec.f_number, of_aperture) {
            return Err(SpecificationError::Contradiction(
                "both `f_number` and `numerical_aperture`; expected one of them".to_owned(),
            ));
        }
        let usual = of_aperture.or_else(of_light);
        match (spec.f_number, usual) {
            (Some(stated), _) => Ok(stated),
            (None, Some(usual)) => {
                Ok(self.or("f_number", None, usual, "from the aperture or the light on the axis"))
            }
            (None, None) => Err(SpecificationError::Missing("f_number")),
        }
    }

    fn fields(&mut self, spec: &LensSpecification) -> Result<Vec<f64>, SpecificationError> {
        let focal_length = self.focal_length;
        let of_image = || spec.image_height_mm.map(|h| (h / focal_length).atan().to_degrees());
        let of_list = || spec.fields_deg.as_ref().and_then(|list| list.last().copied());
        let half = match (spec.half_field_deg, of_list().or_else(of_image)) {
            (Some(stated), _) => stated,
            (None, Some(usual)) => {
                self.or("half_field_deg", None, usual, "from the last field or the image height")
            }
            (None, None) => return Err(SpecificationError::Missing("half_field_deg")),
        };
        let usual = if half > 0.0 { vec![0.0, 0.7 * half, half] } else { vec![0.0] };
        Ok(self.or("fields_deg", spec.fields_deg.as_ref(), usual, "0, 0.7 and 1 of the field"))
    }

    /// The remaining requirements, with the usual values for those that are not stated.
    fn rest(
        &mut self,
        spec: &LensSpecification,
        object: Option<NearObject>,
        (f_number, fields): (f64, Vec<f64>),
    ) -> Result<LensRequirements, SpecificationError> {
        let f = self.focal_length;
        if spec.object.is_none() && object.is_none() {
            self.or("object", None, "infinity".to_owned(), "a distant object");
        }
        let wavelengths = self.wavelengths(spec);
        let glasses = GlassChoice::of(&self.glasses(spec))?;
        let half = fields.last().copied().unwrap_or(0.0);
        let (elements, aspheric_surfaces) = self.element_counts(spec, f_number, half);
        let (relative_illumination, clear_area) = self.light(spec, f_number, &fields);
        let [glass_center, glass_edge, air_center] = self.thinnest_gaps(spec);
        let wish = self.wish(spec);
        let as_built = self.as_built(spec, glasses.plastics.is_some())?;
        let track = spec.max_track_mm.as_ref();
        let distortion = if half > 30.0 { 0.04 } else { 0.02 };
        let semi_diameter = usual_semi_diameter(f, f_number, half);
        Ok(LensRequirements {
            focal_length: f,
            object,
            wish,
            f_number,
            back_focus: self.or("min_back_focus_mm", spec.min_back_focus_mm.as_ref(), 0.0, "none"),
            track: self.or("max_track_mm", track, 2.5 * f, "2.5 focal lengths"),
            elements,
            aspheric_surfaces,
            glasses,
            distortion: self.or(
                "max_abs_distortion",
                spec.max_abs_distortion.as_ref(),
                distortion,
                "hardly visible",
            ),
            relative_illumination,
            clear_area,
            semi_diameter: self.or(
                "max_semi_diameter_mm",
                spec.max_semi_diameter_mm.as_ref(),
                semi_diameter,
                "room for the beams",
            ),
            glass_center,
            glass_edge,
            air_center,
            as_built,
            wavelengths,
            fields,
        })
    }

    /// The largest numbers of elements and of aspheric surfaces.
    fn element_counts(
        &mut self,
        spec: &LensSpecification,
        f_number: f64,
        half: f64,
    ) -> (usize, usize) {
        let usual = usual_elements(f_number, half);
        let reason = "the usual form for this aperture and field";
        let elements = self.or("max_elements", spec.max_elements.as_ref(), usual, reason);
        let aspheres = spec.max_aspheric_surfaces.as_ref();
        let reason = "spheres and planes are cheap";
        (elements, self.or("max_aspheric_surfaces", aspheres, 0, reason))
    }

    /// The least relative illumination and the least clear areas in mm², by field.
    fn light(
        &mut self,
        spec: &LensSpecification,
        f_number: f64,
        fields: &[f64],
    ) -> (Vec<f64>, Vec<f64>) {
        let reason = "vignetting of a good camera lens";
        let stated = spec.min_relative_illumination.as_ref();
        let relative = self.or("min_relative_illumination", stated, usual_light(fields), reason);
        let usual = usual_areas(self.focal_length, f_number, fields);
        let stated = spec.min_clear_area_mm2.as_ref();
        (relative, self.or("min_clear_area_mm2", stated, usual, reason))
    }

    /// The least thickness of glass at its center, of glass at its edge and of air, in mm.
    fn thinnest_gaps(&mut self, spec: &LensSpecification) -> [f64; 3] {
        let thin = (0.02 * self.focal_length).clamp(0.25, 1.0);
        let (center, edge) = (spec.min_glass_center_mm.as_ref(), spec.min_edge_mm.as_ref());
        [
            self.or("min_glass_center_mm", center, thin, "what can be polished"),
            self.or("min_edge_mm", edge, 0.8 * thin, "no chips"),
            self.or("min_air_mm", spec.min_air_mm.as_ref(), 0.05, "no contact"),
        ]
    }

    /// The quality that the lens is to excel in.
    fn wish(&mut self, spec: &LensSpecification) -> LensWish {
        spec.wish.unwrap_or_else(|| {
            let (key, value) = ("wish", "rms".to_owned());
            self.filled.push(FilledValue { key, value, reason: "the smallest spots" });
            LensWish::Rms
        })
    }

    /// The class of care in making; moulded plastic where plastics are permitted.
    fn as_built(
        &mut self,
        spec: &LensSpecification,
        plastics: bool,
    ) -> Result<Option<ToleranceGrade>, SpecificationError> {
        let (usual, reason) = if plastics {
            ("moulded_plastic", "plastics are moulded")
        } else {
            ("precision", "what a good shop keeps without a surcharge")
        };
        let key = self.or("as_built", spec.as_built.as_ref(), usual.to_owned(), reason);
        let found = AS_BUILT_GRADES.iter().find(|(name, _)| *name == key);
        found.map(|(_, grade)| *grade).ok_or_else(|| {
            let expected = "none, commercial, precision, shop_limit or moulded_plastic";
            SpecificationError::invalid("as_built", format!("`{key}`"), expected)
        })
    }

    /// The wavelengths in um with their weights.
    fn wavelengths(&mut self, spec: &LensSpecification) -> Vec<(f64, f64)> {
        let usual = vec![line::F, line::D, line::C];
        let ums = self.or("wavelengths_um", spec.wavelengths_um.as_ref(), usual, "visible light");
        let ones = vec![1.0; ums.len()];
        let weights = spec.wavelength_weights.as_ref();
        let weights = self.or("wavelength_weights", weights, ones, "equal weights");
        ums.into_iter().zip(weights).collect()
    }

    /// The permitted glasses.
    fn glasses(&mut self, spec: &LensSpecification) -> GlassList {
        spec.glasses.clone().unwrap_or_else(|| {
            self.or("glasses", None, ANY_GLASS.to_owned(), "no restriction");
            GlassList::Words(ANY_GLASS.to_owned())
        })
    }
}

/// The number of elements of the usual form (Smith, *Modern Lens Design*).
fn usual_elements(f_number: f64, half_field: f64) -> usize {
    let forms = [
        (3.5, 3.0, 2),
        (3.5, 22.0, 3),
        (2.7, 25.0, 4),
        (1.6, 10.0, 4),
        (1.8, 24.0, 6),
        (1.3, 24.0, 7),
        (3.4, 35.0, 6),
    ];
    let fits = forms.iter().filter(|(n, field, _)| f_number >= *n && half_field <= *field);
    fits.map(|(_, _, elements)| *elements).min().unwrap_or(8)
}

/// The field relative to the last one, squared.
fn squared_part(fields: &[f64], field: f64) -> f64 {
    let last = fields.last().copied().unwrap_or(0.0);
    if last > 0.0 { (field / last).powi(2) } else { 0.0 }
}

fn usual_light(fields: &[f64]) -> Vec<f64> {
    let light =
        |field: &f64| field.to_radians().cos().powi(4) * (1.0 - 0.5 * squared_part(fields, *field));
    fields.iter().map(light).collect()
}

fn usual_areas(f: f64, f_number: f64, fields: &[f64]) -> Vec<f64> {
    let full = CLEAR_ON_AXIS * PI / 4.0 * (f / f_number).powi(2);
    let area = |field: &f64| full * (1.0 - 0.45 * squared_part(fields, *field));
    fields.iter().map(area).collect()
}

fn usual_semi_diameter(f: f64, f_number: f64, half_field: f64) -> f64 {
    0.55 * f / f_number + 0.6 * f * half_field.min(60.0).to_radians().tan()
}

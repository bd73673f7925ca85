//! The names by which options call the choices of the library.

use crate::files::VignettingChoice;
use crate::lens::ParameterKind;
use crate::measure::{Integral, SearchContender};
use crate::optimize::DescentMethod;
use crate::optimize::pareto::Scalarization;
use crate::search::SearchMethod;
use crate::tolerance::{FocusTreatment, ToleranceGrade};
use clap::ValueEnum;
use clap::builder::PossibleValue;

/// The name of a choice.
pub(super) fn value_name(value: &impl ValueEnum) -> String {
    value.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default()
}

fn value(name: &'static str, help: &'static str) -> PossibleValue {
    PossibleValue::new(name).help(help)
}

impl ValueEnum for VignettingChoice {
    fn value_variants<'a>() -> &'a [Self] {
        &Self::ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let help = match self {
            Self::Rims => "The apertures of the file clip, its factors are left out",
            Self::Factors => "Surfaces are as wide as the rays at the edges of the factors need",
        };
        Some(value(self.name(), help))
    }
}

impl ValueEnum for FocusTreatment {
    fn value_variants<'a>() -> &'a [Self] {
        &[Self::Refocused, Self::Fixed]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(match self {
            Self::Refocused => value("refocused", "At the best focus of each lens"),
            Self::Fixed => value("fixed", "At the image plane of the lens as designed"),
        })
    }
}

impl ValueEnum for Scalarization {
    fn value_variants<'a>() -> &'a [Self] {
        &[Self::EpsilonConstraint, Self::WeightedSum]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(match self {
            Self::EpsilonConstraint => {
                value("epsilon-constraint", "The sharpest lens with at least so much light")
            }
            Self::WeightedSum => {
                value("weighted-sum", "The least weighted sum of spot and light (Teh, 3.26)")
            }
        })
    }
}

impl ValueEnum for DescentMethod {
    fn value_variants<'a>() -> &'a [Self] {
        &Self::ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(match self {
            Self::TrustRegion => {
                value("trust-region", "A trust region with secant second derivatives")
            }
            Self::DampedLeastSquares => value("dls", "Damped least squares"),
            Self::Adam => value("adam", "Adam: first order, with moments"),
        })
    }
}

impl ValueEnum for ToleranceGrade {
    fn value_variants<'a>() -> &'a [Self] {
        &[Self::Commercial, Self::Precision, Self::ShopLimit, Self::MouldedPlastic]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(match self {
            Self::Commercial => value("commercial", "What every shop delivers"),
            Self::Precision => value("precision", "What a good shop delivers"),
            Self::ShopLimit => value("shop-limit", "The limit of a good shop"),
            Self::MouldedPlastic => value("moulded", "Moulded plastic elements of a phone camera"),
        })
    }
}

impl ValueEnum for SearchMethod {
    fn value_variants<'a>() -> &'a [Self] {
        &[Self::IteratedLocalSearch, Self::Restore, Self::Metropolis, Self::BruteForce]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(match self {
            Self::IteratedLocalSearch => {
                value("iterated", "Mutants of the best lenses race; the better lens goes on")
            }
            Self::Restore => {
                value("restore", "Descents that end at random and restart from the reservoir")
            }
            Self::Metropolis => value("metropolis", "Metropolis-Hastings with Langevin steps"),
            Self::BruteForce => value("brute", "Each element added and removed once"),
        })
    }
}

impl ValueEnum for SearchContender {
    fn value_variants<'a>() -> &'a [Self] {
        &Self::ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        match self {
            Self::Sampler(method) => method.to_possible_value(),
            Self::BasinHopping => Some(value(
                "basin-hopping",
                "All variables displaced at random, the structure kept",
            )),
            Self::SingleTrial => {
                Some(value("single-trial", "As `iterated`, with one mutant at a time"))
            }
            Self::Descent => Some(value("descent", "From the start without mutations")),
        }
    }
}

impl ValueEnum for ParameterKind {
    fn value_variants<'a>() -> &'a [Self] {
        &[
            Self::Curvatures,
            Self::Thicknesses,
            Self::Conics,
            Self::Aspheres,
            Self::Indices,
            Self::SemiDiameters,
            Self::GrinCoefficients,
        ]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(match self {
            Self::Curvatures => value("curvatures", "All curvatures that refract or reflect"),
            Self::Thicknesses => {
                value("thicknesses", "All gaps; a gap that zooms, at each zoom position")
            }
            Self::Conics => value("conics", "All conic constants other than 0"),
            Self::Aspheres => value("aspheres", "All asphere coefficients of the file"),
            Self::Indices => value("indices", "All indices of model glasses and constant media"),
            Self::SemiDiameters => value("semi-diameters", "All semi-diameters of the file"),
            Self::GrinCoefficients => {
                value("gradients", "All coefficients of gradient-index media of the file")
            }
        })
    }
}

impl ValueEnum for Integral {
    fn value_variants<'a>() -> &'a [Self] {
        &[Self::Spot, Self::Throughput]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(match self {
            Self::Spot => value("spot", "The squared distance from the centroid of the spot"),
            Self::Throughput => value("throughput", "Minus one: the transmitted light"),
        })
    }
}

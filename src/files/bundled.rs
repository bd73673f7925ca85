//! Bundled lenses: the folder `lenses/`, embedded in the program.

/// A bundled lens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BundledLens {
    /// The name of its file in `lenses/`, without `.json`.
    pub name: &'static str,
    /// The title in menus.
    pub title: &'static str,
    /// The text of the file.
    pub text: &'static str,
}

/// All lenses of the folder `lenses/`; the first is the one that the studio opens.
pub fn bundled_lenses() -> &'static [BundledLens] {
    LENSES
}

macro_rules! lenses {
    ($($name:literal: $title:literal,)*) => {
        &[$(BundledLens {
            name: $name,
            title: $title,
            text: include_str!(concat!("../../lenses/", $name, ".json")),
        },)*]
    };
}

const LENSES: &[BundledLens] = lenses! {
    "double_gauss_rudolph_50": "Double Gauss 50 mm f/4.5 (Rudolph)",
    "double_gauss_nikkor_s_50": "Double Gauss 50 mm f/2 (Nikkor-S)",
    "double_gauss_nikkor_s_50_patent": "Double Gauss 50 mm f/1.4 (Nikkor-S, patent)",
    "double_gauss_canon_ef50_f18": "Double Gauss 50 mm f/1.8 (Canon EF)",
    "double_gauss_canon_fd50_f12": "Double Gauss 50 mm f/1.2 (Canon FD, asphere)",
    "singlet_la1131": "Singlet 50 mm (LA1131)",
    "achromat_ac254_100": "Achromat 100 mm (AC254-100)",
    "cooke_triplet_100_f27": "Triplet 100 mm f/2.7",
    "tessar_50_f28": "Tessar 50 mm f/2.8",
    "heliar_100_f45": "Heliar 100 mm f/4.5",
    "petzval_kodak_100_f22": "Petzval 100 mm f/2.2",
    "telephoto_nikkor_135_f28": "Telephoto 135 mm f/2.8 (Nikkor)",
    "macro_micro_nikkor_105_f28": "Macro 105 mm f/2.8 (Micro-Nikkor)",
    "wide_nikkor_28_f28": "Retrofocus 28 mm f/2.8 (Nikkor)",
    "wide_nikkor_28_f35": "Retrofocus 28 mm f/3.5 (Nikkor)",
    "fisheye_minolta_16_f28": "Fisheye 16 mm f/2.8 (Minolta)",
    "zoom_nikkor_28_80": "Zoom 28.8-78 mm (Nikkor)",
    "zoom_tamron_28_75_f28": "Zoom 28.9-72.7 mm f/2.9 (Tamron)",
    "phone_us7558005_1": "Phone lens 4.6 mm f/3 (aspheres)",
    "microscope_us5000548_1": "Microscope objective NA 0.25",
    "telescope_rc_f8": "Ritchey-Chretien telescope f/8",
    "grin_rod_melles_griot": "Gradient-index rod 1.9 mm (Melles Griot)",
    "wood_lens_60": "Wood lens 60 mm f/4 (gradient across)",
    "axial_gradient_singlet_50": "Singlet 50 mm f/2.5 (gradient along)",
};

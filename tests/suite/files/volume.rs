//! Volumes: both formats round-trip every bit, and errors are named.

use super::folder;
use aplanat::files::{Volume, read_volume, write_volume};
use aplanat::grin::field::{RegularGrid, Trilinear};
use aplanat::math::Vec3;
use std::path::Path;

fn example() -> Volume {
    let grid =
        RegularGrid::new([4, 3, 2], Vec3::new(-1.0, 0.5, 0.0), Vec3::new(0.1, 0.2, 1.0 / 3.0));
    let grid = grid.unwrap();
    let values =
        (0..grid.node_count()).map(|n| 1.0 + (n as f64 * 0.618034).fract() / 3.0).collect();
    Volume { grid, values }
}

#[test]
fn grin_volumes_round_trip_bit_for_bit() {
    let folder = folder("volume");
    for name in ["lens.npz", "lens.json"] {
        let path = folder.join(name);
        write_volume(&path, &example()).unwrap();
        let again = read_volume(&path).unwrap();
        assert_eq!(again, example(), "{name}");
        assert!(Trilinear::new(again.grid, again.values).is_ok());
    }
}

#[test]
fn grin_volumes_of_numpy_are_read_in_any_order_and_precision() {
    // Written by NumPy 2: `index` as float32, in Fortran's order, compressed; `low` as integers.
    let volume = read_volume(Path::new("tests/files/volume_numpy.npz")).unwrap();
    assert_eq!(volume.grid.counts(), [4, 3, 2]);
    assert_eq!(volume.grid.low(), Vec3::new(-1.0, 0.0, 2.0));
    assert_eq!(volume.grid.spacing(), Vec3::new(0.5, 0.25, 0.125));
    // a[k, j, i] = 1 + k + j/4 + i/16
    for n in 0..volume.grid.node_count() {
        let (i, j, k) = (n % 4, n / 4 % 3, n / 12);
        let value = 1.0 + k as f64 + j as f64 / 4.0 + i as f64 / 16.0;
        assert_eq!(volume.values[n], value, "{i} {j} {k}");
    }
}

#[test]
fn grin_invalid_volumes_name_the_place() {
    let folder = folder("wrong volume");
    let refusal = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        std::fs::write(&path, bytes).unwrap();
        read_volume(&path).unwrap_err().to_string()
    };
    let text = refusal("empty.npz", b"PK\x05\x06");
    assert!(text.contains("array index") && text.contains("low and spacing"), "{text}");
    let text = refusal("lens.json", br#"{"aplanat_volume": 1, "size": 3}"#);
    assert!(text.contains("line 1") && text.contains("the unknown key `size`"), "{text}");
    assert!(refusal("lens.zmx", b"VERS 1").contains("the header of a volume"));
    assert!(refusal("lens.zmx", b"VERS 1").contains("the text `VERS 1`"));
    let text = refusal("lens.zmx", b"VE\x00\x01");
    assert!(text.contains("the bytes [56, 45, 00, 01]"), "{text}");
    let header = |counts: &str, spacing: &str| {
        format!(
            r#"{{"aplanat_volume": 1, "counts": {counts}, "low": [0, 0, 0], "spacing": {spacing},
                "numbers": "f32", "data": "lens.raw"}}"#
        )
    };
    let text = refusal("lens.json", header("[2, 2, 2]", "[1, 1, 1]").as_bytes());
    assert!(text.contains("lens.raw: cannot be read"), "{text}");
    std::fs::write(folder.join("lens.raw"), 1.5f32.to_le_bytes().repeat(8)).unwrap();
    std::fs::write(folder.join("good.json"), header("[2, 2, 2]", "[1, 1, 1]")).unwrap();
    assert_eq!(read_volume(&folder.join("good.json")).unwrap().values, [1.5; 8]);
    let text = refusal("lens.json", header("[2, 2, 3]", "[1, 1, 1]").as_bytes());
    assert!(text.contains("8 values for [2, 2, 3] nodes"), "{text}");
    let text = refusal("lens.json", header("[2, 2, 2]", "[1, 0, 1]").as_bytes());
    assert!(text.contains("no extent along y"), "{text}");
    let huge = "[18446744073709551615, 2, 2]";
    assert!(refusal("lens.json", header(huge, "[1, 1, 1]").as_bytes()).contains("8 values"));
    assert!(read_volume(&folder.join("none.npz")).is_err());
}

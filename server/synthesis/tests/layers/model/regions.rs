//! What grasps earn by the regions of their object.

use grasp_synthesis::model::score::{RegionTerm, RegionValue, Score};

use crate::prelude::*;

fn contact(triangle: u32, x: f32) -> Contact {
    Contact {
        position: Vec3::X * x,
        normal: Vec3::Y,
        triangle,
        part: HandPart::Palm,
    }
}

fn region(wish: Wish, weight: f32, triangles: &[u32], from_x: Option<f32>) -> Region {
    Region {
        wish,
        weight,
        triangles: triangles.to_vec(),
        zones: from_x
            .map(|x| half_space(Vec3::X * x, Vec3::X))
            .into_iter()
            .collect(),
    }
}

#[test]
fn contacts_earn_the_weight_of_what_they_are_on() {
    let regions = Regions::new(
        &[
            region(Wish::Prefer, 0.8, &[1], None),
            region(Wish::Prefer, 0.4, &[1, 2], Some(5.0)),
            region(Wish::Avoid, 0.5, &[], Some(7.0)),
        ],
        10,
    );
    // On 0.8, on 0.4 by its triangle, on 0.4 by its place, on that and on what is to be avoided.
    let contacts = [contact(1, 0.0), contact(2, 0.0), contact(3, 6.0), contact(4, 8.0)];
    let [preferred, avoided] = regions
        .values(&contacts)
        .map(|value| value.expect("there are regions"));
    assert!((preferred.value - (0.8 + 3.0 * 0.4) / 4.0 / 0.8).abs() < 1e-6);
    assert_eq!((preferred.importance, avoided.importance), (0.8, 0.5));
    assert!((avoided.value - 0.75).abs() < 1e-6);
    let wishes = [(1, 0.0), (2, 0.0), (9, 0.0), (9, 8.0)].map(|(t, x)| regions.wish_at(t, Vec3::X * x));
    for (wish, expected) in wishes.into_iter().zip([1.0, 0.6, 0.2, 0.6 * 0.5]) {
        assert!((wish - expected).abs() < 1e-6, "{wishes:?}");
    }
}

#[test]
fn regions_scale_with_their_object() {
    let regions = Regions::new(&[region(Wish::Avoid, 1.0, &[3], Some(2.0))], 4);
    let doubled = regions.scaled(2.0);
    for (triangle, x) in [(0, 1.0), (0, 3.0), (3, 1.0)] {
        assert_eq!(
            doubled.wish_at(triangle, Vec3::X * x * 2.0),
            regions.wish_at(triangle, Vec3::X * x)
        );
    }
}

#[test]
fn an_object_without_regions_has_no_terms_for_them() {
    let regions = Regions::new(&[], 4);
    assert!(regions.is_empty());
    assert_eq!(regions.values(&[contact(0, 0.0)]), [None; 2]);
    assert_eq!(regions.wish_at(0, Vec3::ZERO), 1.0);
    // Triangles that do not exist mark nothing.
    assert_eq!(
        Regions::new(&[region(Wish::Prefer, 1.0, &[9], None)], 4).wish_at(9, Vec3::ZERO),
        0.0
    );
}

#[test]
fn the_total_is_the_weighted_mean_of_the_terms() {
    let values = std::array::from_fn(|term| term as f32 / 20.0);
    let plain = Score {
        values,
        regions: [None; 2],
    };
    let earned = RegionValue {
        value: 0.25,
        importance: 0.5,
    };
    let rated = Score {
        regions: [None, Some(earned)],
        ..plain
    };
    for score in [plain, rated] {
        let weights: f32 = score.terms().map(|term| term.weight).sum();
        let mean = score.terms().map(|term| term.weight * term.value).sum::<f32>() / weights;
        assert!((score.total() - mean).abs() < 1e-6);
    }
    assert_eq!(plain.terms().count(), 20);
    assert_eq!(
        rated.terms().last().map(|term| term.name),
        Some(RegionTerm::OffAvoided.name())
    );
}

//! Parts of an object that hands should take or leave, as its owner states them.

use glam::Vec3;

use super::{
    grasp::Contact,
    score::{RegionTerm, RegionValue, RegionValues},
};
use crate::geometry::zone::Zone;

/// Largest share of a preferred region's weight that contacts may miss in a natural grasp.
pub(crate) const MAX_MISSED: f32 = 0.5;

/// Largest share of weight to avoid under the contacts of a natural grasp.
const MAX_AVOIDED: f32 = 0.1;

/// Preference of a region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wish {
    /// Hands should take the object elsewhere.
    Avoid,
    /// Hands should take it there.
    Prefer,
}

/// A part of an object's surface: triangles, and the surface inside some zones.
#[derive(Clone, Debug, PartialEq)]
pub struct Region {
    /// The preference.
    pub wish: Wish,
    /// Its weight; more than 0, at most 1.
    pub weight: f32,
    /// Indices of triangles. Those that do not exist are ignored.
    pub triangles: Vec<u32>,
    /// Zones in the object's frame.
    pub zones: Vec<Zone>,
}

/// The regions of an object; none by default.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Regions {
    /// In the owner's order, each with ascending triangles.
    all: Vec<Region>,
    preferred: Marked,
    avoided: Marked,
}

/// Weights of a surface's triangles for one preference.
#[derive(Clone, Debug, Default, PartialEq)]
struct Marked {
    /// The weight of each triangle; empty if all are 0.
    triangles: Vec<f32>,
    zones: Vec<(Zone, f32)>,
    /// The largest weight; 0 without regions.
    greatest: f32,
}

impl Regions {
    /// Prepares the regions of a surface of so many triangles. Where regions of the same preference overlap, the largest weight
    /// decides.
    pub fn new(regions: &[Region], triangles: usize) -> Self {
        let mut prepared = Self {
            all: regions.to_vec(),
            ..Self::default()
        };
        for region in &mut prepared.all {
            let marked = match region.wish {
                Wish::Avoid => &mut prepared.avoided,
                Wish::Prefer => &mut prepared.preferred,
            };
            marked.add(region, triangles);
            region.triangles.sort_unstable();
        }
        prepared
    }

    /// Index of the region with most of the contacts, the first of several; `None` if all contacts are elsewhere.
    pub(crate) fn with_most(&self, contacts: &[Contact]) -> Option<usize> {
        let held = |region: &Region| contacts.iter().filter(|at| region.contains(at)).count();
        let counts = self.all.iter().map(held).enumerate();
        let most = counts.max_by_key(|&(index, count)| (count, std::cmp::Reverse(index)));
        most.and_then(|(index, count)| (count > 0).then_some(index))
    }

    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// True if a grasp with its contacts elsewhere than on preferred regions is not natural.
    pub fn require_contacts(&self) -> bool {
        self.preferred.greatest > MAX_MISSED
    }

    /// Numbers that differ for regions that prefer different places.
    pub fn numbers(&self) -> impl Iterator<Item = f32> {
        [&self.preferred, &self.avoided]
            .into_iter()
            .flat_map(Marked::numbers)
    }

    /// The same regions of the object at another size.
    #[must_use]
    pub fn scaled(&self, scale: f32) -> Self {
        let mut scaled = self.clone();
        let zones = scaled.all.iter_mut().flat_map(|region| &mut region.zones);
        let marked = [&mut scaled.preferred, &mut scaled.avoided];
        let marked = marked.into_iter().flat_map(|marked| &mut marked.zones);
        for zone in zones.chain(marked.map(|(zone, _)| zone)) {
            *zone = zone.scaled(scale);
        }
        scaled
    }

    /// The owner's preference for a place of the surface, from 0 to 1: 1 where no other place is preferred.
    pub fn wish_at(&self, triangle: u32, position: Vec3) -> f32 {
        let missed = self.preferred.greatest - self.preferred.weight_at(triangle, position);
        (1.0 - missed) * (1.0 - self.avoided.weight_at(triangle, position))
    }

    /// The score's region terms for contacts; `None` without regions. The share of contacts on preferred regions, and off those
    /// to avoid, each counted by its weight relative to the largest.
    pub fn values(&self, contacts: &[Contact]) -> RegionValues {
        RegionTerm::ALL.map(|term| {
            let marked = match term {
                RegionTerm::OnPreferred => &self.preferred,
                RegionTerm::OffAvoided => &self.avoided,
            };
            (marked.greatest > 0.0).then(|| {
                let on = marked.share(contacts) / marked.greatest;
                RegionValue {
                    value: match term {
                        RegionTerm::OnPreferred => on,
                        RegionTerm::OffAvoided => 1.0 - on,
                    },
                    importance: marked.greatest,
                }
            })
        })
    }

    /// Memory use in bytes.
    pub fn bytes(&self) -> usize {
        let regions: usize = self.all.iter().map(Region::bytes).sum();
        self.preferred.bytes() + self.avoided.bytes() + regions
    }
}

/// True if contacts with these region terms make a natural grasp.
pub fn suits_owner(values: &RegionValues) -> bool {
    RegionTerm::ALL.into_iter().zip(values).all(|(term, earned)| {
        let most = match term {
            RegionTerm::OnPreferred => MAX_MISSED,
            RegionTerm::OffAvoided => MAX_AVOIDED,
        };
        earned.is_none_or(|earned| (1.0 - earned.value) * earned.importance <= most)
    })
}

impl Region {
    fn contains(&self, at: &Contact) -> bool {
        self.triangles.binary_search(&at.triangle).is_ok()
            || self.zones.iter().any(|zone| zone.contains(at.position))
    }

    fn bytes(&self) -> usize {
        let zones: usize = self.zones.iter().map(Zone::bytes).sum();
        size_of_val(self.triangles.as_slice()) + zones
    }
}

impl Marked {
    fn add(&mut self, region: &Region, triangles: usize) {
        if !region.triangles.is_empty() {
            self.triangles.resize(triangles, 0.0);
        }
        for &triangle in &region.triangles {
            if let Some(weight) = self.triangles.get_mut(triangle as usize) {
                *weight = weight.max(region.weight);
            }
        }
        let zones = region.zones.iter().cloned();
        self.zones.extend(zones.map(|zone| (zone, region.weight)));
        self.greatest = self.greatest.max(region.weight);
    }

    /// The weight of a place, from 0 to the largest weight.
    fn weight_at(&self, triangle: u32, position: Vec3) -> f32 {
        let of_triangle = self.triangles.get(triangle as usize).copied().unwrap_or_default();
        self.zones.iter().fold(of_triangle, |most, (zone, weight)| {
            if *weight > most && zone.contains(position) {
                *weight
            } else {
                most
            }
        })
    }

    fn numbers(&self) -> impl Iterator<Item = f32> {
        let counts = [self.triangles.len() as f32, self.zones.len() as f32];
        let zones = self.zones.iter().flat_map(|(zone, weight)| {
            let mut numbers = zone.numbers();
            numbers.push(*weight);
            numbers
        });
        counts
            .into_iter()
            .chain(self.triangles.iter().copied())
            .chain(zones)
    }

    /// The mean weight of contacts; 0 without any.
    fn share(&self, contacts: &[Contact]) -> f32 {
        let weights = contacts.iter().map(|at| self.weight_at(at.triangle, at.position));
        weights.sum::<f32>() / contacts.len().max(1) as f32
    }

    fn bytes(&self) -> usize {
        let of_zones: usize = self.zones.iter().map(|(zone, _)| zone.bytes()).sum();
        size_of_val(self.triangles.as_slice()) + of_zones
    }
}

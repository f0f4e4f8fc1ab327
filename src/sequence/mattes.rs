//! Mattes: which named objects and materials each pixel shows, and how much of it they cover.

use super::antialias::Antialias;
use super::resolve::Resolver;
use crate::frame::{Cover, Matte, SurfaceSample};
use crate::infer::BuzzBuffer;
use crate::scene::Scene;
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;

/// What mattes are picked by.
pub(super) struct MatteNames {
    objects: Names,
    materials: Names,
}

/// The names that instances have.
struct Names {
    /// Each once: what shares a name shares a matte.
    names: Arc<[String]>,
    /// For each instance the position of its name, counted from 1.
    numbers: Vec<u32>,
}

impl MatteNames {
    pub fn of(scene: &Scene) -> Self {
        let instances = || scene.instances.iter();
        let objects = instances().map(|instance| scene.object_name(instance));
        let materials = instances().map(|instance| scene.material_name(instance));
        Self { objects: Names::of(objects), materials: Names::of(materials) }
    }
}

impl Names {
    fn of(of_instances: impl Iterator<Item = String>) -> Self {
        let (mut names, mut known) = (Vec::new(), HashMap::new());
        let number = |name: String| {
            *known.entry(name).or_insert_with_key(|name| {
                names.push(name.clone());
                names.len() as u32
            })
        };
        let numbers = of_instances.map(number).collect();
        Self { names: names.into(), numbers }
    }
}

impl Resolver<'_> {
    /// Fills the mattes: a pixel is covered by what its centre shows or, super-sampled, by what the samples that its colour is
    /// the mean of show, with the same weights.
    pub(super) fn fill_mattes(&self, buffer: &BuzzBuffer, antialias: &Antialias, mattes: &mut Vec<Matte>) {
        let Some(MatteNames { objects, materials }) = self.names else { return mattes.clear() };
        let layers = [("CryptoObject", objects), ("CryptoMaterial", materials)];
        let ranks = Matte::ranks(self.settings.aa);
        let empty = || Matte { layer: "", names: Arc::default(), ranks, covers: Vec::new() };
        mattes.resize_with(layers.len(), empty);
        for (matte, (layer, names)) in mattes.iter_mut().zip(layers) {
            (matte.layer, matte.names, matte.ranks) = (layer, Arc::clone(&names.names), ranks);
            matte.covers.resize(self.settings.window.pixels() * ranks, Cover::default());
            let name = |sample: &SurfaceSample| {
                let SurfaceSample { surface, .. } = sample;
                if surface.is_background() { 0 } else { names.numbers[surface.instance as usize] }
            };
            let pixels = matte.covers.par_chunks_mut(ranks).enumerate().with_min_len(1 << 10);
            pixels.for_each_init(Vec::new, |found, (pixel, covers)| {
                if self.observer.stop_requested().is_some() {
                    return;
                }
                found.clear();
                if ranks > 1 {
                    let samples = antialias.samples(buffer);
                    antialias.visit(buffer, pixel, |number, share| {
                        add(found, Cover { name: name(&samples.get(number).0), share });
                    });
                } else {
                    add(found, Cover { name: name(&buffer.sample(pixel)), share: 1.0 });
                }
                rank(found, covers);
            });
        }
    }
}

/// Adds to what covers a pixel; nothing covers none of it.
fn add(found: &mut Vec<Cover>, cover: Cover) {
    if cover.name == 0 {
        return;
    }
    match found.iter_mut().find(|known| known.name == cover.name) {
        Some(known) => known.share += cover.share,
        None => found.push(cover),
    }
}

/// Keeps what covers most, in order.
fn rank(found: &mut [Cover], covers: &mut [Cover]) {
    found.sort_unstable_by(|a, b| b.share.total_cmp(&a.share).then(a.name.cmp(&b.name)));
    covers.fill(Cover::default());
    covers.iter_mut().zip(found).for_each(|(cover, found)| *cover = *found);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_shares_a_name_shares_a_matte() {
        let names = Names::of(["leaf", "stem", "leaf"].map(String::from).into_iter());
        assert_eq!(
            (&names.names[..], &names.numbers[..]),
            (&["leaf".into(), "stem".into()][..], &[1, 2, 1][..])
        );
    }

    #[test]
    fn what_covers_most_comes_first_and_the_least_is_left_out() {
        let mut found = Vec::new();
        for (name, share) in [(3, 0.125), (0, 0.25), (2, 0.25), (3, 0.0625), (1, 0.25), (4, 0.0625)] {
            add(&mut found, Cover { name, share });
        }
        let ranked = |ranks: usize| {
            let mut covers = vec![Cover { name: 9, share: 9.0 }; ranks];
            rank(&mut found.clone(), &mut covers);
            covers.iter().map(|cover| (cover.name, cover.share)).collect::<Vec<_>>()
        };
        assert_eq!(ranked(3), [(1, 0.25), (2, 0.25), (3, 0.1875)]);
        assert_eq!(ranked(6)[3..], [(4, 0.0625), (0, 0.0), (0, 0.0)]);
    }
}

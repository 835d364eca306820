//! Colours and other values of vertices and faces.

use super::header::{Element, Scalar};
use crate::base::math::{Rgb, linear_from_srgb};

/// What a name's last part makes of a property: components of one value.
const PARTS: [[&str; 3]; 4] = [["r", "g", "b"], ["x", "y", "z"], ["0", "1", "2"], ["1", "2", "3"]];
const COLORS: [[&str; 3]; 3] = [["r", "g", "b"], ["red", "green", "blue"], ["diffuse_red", "diffuse_green", "diffuse_blue"]];

/// An attribute, and the properties that are its components.
pub struct Channels {
    /// As Mitsuba calls it.
    pub name: String,
    places: Vec<usize>,
    /// The largest number of integers that are sRGB-encoded.
    srgb: Option<f64>,
}

impl Channels {
    /// The value in a row of all properties; a single number is all three.
    pub fn value(&self, row: &[f64]) -> Rgb {
        let component = |i: usize| {
            let x = self.places.get(i).map_or(0.0, |&place| row[place]);
            self.srgb.map_or(x as f32, |largest| linear_from_srgb((x / largest) as f32))
        };
        match self.places.len() {
            1 => Rgb::splat(component(0)),
            _ => Rgb::new(component(0), component(1), component(2)),
        }
    }
}

/// The attributes of an element whose properties at `taken` mean something else.
pub fn find(element: &Element, prefix: &str, taken: &[usize]) -> Vec<Channels> {
    let mut found = Vec::new();
    let free = |name: &str| element.number(name).filter(|i| !taken.contains(i));
    let integer = |i: usize| -> Option<f64> { Scalar::largest(element.properties[i].kind) };
    let color = COLORS.iter().find_map(|names| {
        let places: Vec<usize> = names.iter().filter_map(|n| free(n)).collect();
        (places.len() == 3).then_some(places)
    });
    if let Some(places) = &color {
        found.push(Channels { name: format!("{prefix}_color"), places: places.clone(), srgb: integer(places[0]) });
    }
    for (i, property) in element.properties.iter().enumerate().filter(|(i, p)| p.list.is_none() && !taken.contains(i)) {
        let Some((stem, last)) = property.name.rsplit_once('_') else { continue };
        if color.as_ref().is_some_and(|places| places.contains(&i)) {
            continue;
        }
        // A value begins with its first component, whose set of names has the most of the others.
        let sets = PARTS.iter().filter(|set| set[0] == last);
        let sets = sets.map(|set| set.iter().map_while(|part| free(&format!("{stem}_{part}"))).collect::<Vec<_>>());
        let Some(places) = sets.max_by_key(Vec::len) else { continue };
        // `foo_1` after `foo_0` begins nothing.
        if last == "1" && free(&format!("{stem}_0")).is_some() {
            continue;
        }
        let name = if last == "r" { format!("{prefix}_{stem}_color") } else { format!("{prefix}_{stem}") };
        found.push(Channels { name, places, srgb: None });
    }
    found
}

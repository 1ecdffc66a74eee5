//! A field drawn as bands of colour, with its colour bar.

use plotters::prelude::*;
use plotters::style::RGBColor;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::body::Frame;
use super::numbers::{number, round_up, rounded};
use super::page::{self, Area, Fallible, px};
use super::region::Region;
use super::style::Style;
use super::theme::{ColourMap, hex};
use solver::element::{Element, Family};

/// The largest number of bands; round limits make at least about half as many.
const BANDS: f64 = 14.0;
/// The side of the cells that an element is divided into (pixels).
const CELL: f64 = 6.0;
/// The largest number of cells along a side of an element.
const MOST_CELLS: usize = 16;
/// The size of an element (pixels) below which it is drawn in one colour.
const SPECK: f64 = 1.5;

/// The height of the colour bar with its numbers and name (pixels).
pub(super) const BAR: i32 = 76;

/// Bands of values between round numbers.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Bands {
    /// The limits between bands, from the lowest to the highest: one more than bands.
    edges: Vec<f64>,
    /// The extremes of the field, if they are beyond the first and the last limit.
    beyond: [Option<f64>; 2],
    colours: ColourMap,
}

impl Bands {
    /// The bands for values at nodes. `near`: value and area of each node in the last window. At a sharp edge a few
    /// nodes may exceed all others, and their values do not converge: the bands then extend beyond the 3rd and the 97th
    /// percentile of values (by area) by half of their difference, and the bar shows the extremes. A field with values
    /// of both signs has colours that differ by sign.
    pub(super) fn of(values: &[f64], mut near: Vec<(f64, f64)>) -> Bands {
        let extreme = |pick: fn(f64, f64) -> f64| values.iter().copied().reduce(pick);
        let least = extreme(f64::min).unwrap_or(0.0);
        let most = extreme(f64::max).unwrap_or(0.0);
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        let area: f64 = near.iter().map(|node| node.1).sum();
        let quantile = |part: f64, otherwise: f64| {
            let mut sum = 0.0;
            let reaches = |node: &&(f64, f64)| {
                sum += node.1;
                sum > part * area
            };
            near.iter().find(reaches).map_or(otherwise, |node| node.0)
        };
        let (low, high) = (quantile(0.03, least), quantile(0.97, most));
        let usual = high - low;
        let lowest = if low - least > usual {
            low - 0.5 * usual
        } else {
            least
        };
        let highest = if most - high > usual {
            high + 0.5 * usual
        } else {
            most
        };
        let span = highest - lowest;
        let step = if span > 1e-9 * most.abs().max(least.abs()) && span.is_normal() {
            round_up(span / BANDS, &[1.0, 2.0, 2.5, 5.0])
        } else {
            most.abs().max(1.0) // one colour
        };
        let first = (lowest / step + 1e-9).floor();
        let count = ((highest / step - 1e-9).ceil() - first).max(1.0);
        let edges: Vec<f64> = (0..=count as usize)
            .map(|k| (first + k as f64) * step)
            .collect();
        let end = edges[edges.len() - 1];
        let beyond = [
            (lowest > least).then_some(least).filter(|v| *v < edges[0]),
            (highest < most).then_some(most).filter(|v| *v > end),
        ];
        let colours = if edges[0] < 0.0 && end > 0.0 {
            ColourMap::Signed
        } else {
            ColourMap::Rising
        };
        Bands {
            edges,
            beyond,
            colours,
        }
    }

    fn count(&self) -> usize {
        self.edges.len() - 1
    }

    /// The number of the band of a value; a value beyond all limits belongs to the first or the last band.
    fn band(&self, value: f64) -> usize {
        let above = self.edges.partition_point(|edge| *edge <= value);
        above.saturating_sub(1).min(self.count() - 1)
    }

    fn colour(&self, band: usize) -> RGBColor {
        let middle = 0.5 * (self.edges[band] + self.edges[band + 1]);
        let (low, high) = (self.edges[0], self.edges[self.count()]);
        let part = match self.colours {
            ColourMap::Rising => band as f64 / (self.count() - 1).max(1) as f64,
            // zero is in the middle of the map, and both signs have the same scale
            ColourMap::Signed => 0.5 + 0.5 * middle / high.max(-low),
        };
        self.colours.at(part)
    }

    /// Draws the field inside a frame, one path for each band.
    pub(super) fn fill(
        &self,
        frame: &Frame,
        elements: &[Element],
        place: &dyn Fn(u32) -> [f64; 2],
        value: &dyn Fn(u32) -> f64,
    ) -> String {
        let mut regions = vec![Region::default(); self.count()];
        for element in elements {
            self.fill_element(&mut regions, frame, element, place, value);
        }
        let drawn = |(k, region): (usize, Region)| {
            let colour = hex(self.colour(k));
            // a line of one pixel closes the seam between neighbours
            region.path().drawn(&format!(
                r#"fill="{colour}" stroke="{colour}" stroke-width="10""#
            ))
        };
        regions.into_iter().enumerate().map(drawn).collect()
    }

    fn fill_element(
        &self,
        regions: &mut [Region],
        frame: &Frame,
        element: &Element,
        place: &dyn Fn(u32) -> [f64; 2],
        value: &dyn Fn(u32) -> f64,
    ) {
        let places = element.gather(|n| frame.at(place(n)));
        let values = element.gather(value);
        let nodes = element.len();
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for p in &places[..nodes] {
            for a in 0..2 {
                low[a] = low[a].min(p[a]);
                high[a] = high[a].max(p[a]);
            }
        }
        if !frame.shows(low, high) {
            return;
        }
        let pixels = (high[0] - low[0]).max(high[1] - low[1]) / f64::from(page::FINE);
        let family = element.family();
        if pixels < SPECK {
            let mean = values[..nodes].iter().sum::<f64>() / nodes as f64;
            regions[self.band(mean)].add(places[..family.corners()].iter().copied());
            return;
        }
        let cells = ((pixels / CELL).ceil() as usize).clamp(1, MOST_CELLS);
        let at = |local: [f64; 2]| {
            let shape = family.shape(local);
            let sum = |f: &dyn Fn(usize) -> f64| (0..nodes).map(|i| shape[i] * f(i)).sum::<f64>();
            Corner {
                place: [sum(&|i| places[i][0]), sum(&|i| places[i][1])],
                value: sum(&|i| values[i]),
            }
        };
        for cell in cut(family, cells, &at) {
            self.fill_cell(regions, &cell);
        }
    }

    /// Adds a convex cell to the regions of the bands, divided at their limits.
    fn fill_cell(&self, regions: &mut [Region], cell: &[Corner]) {
        let bands = cell.iter().map(|corner| self.band(corner.value));
        let (low, high) = bands.fold((usize::MAX, 0), |(l, h), b| (l.min(b), h.max(b)));
        if low == high {
            regions[low].add(cell.iter().map(|corner| corner.place));
            return;
        }
        // the field is linear only in a triangle
        for k in 1..cell.len() - 1 {
            let triangle = [cell[0], cell[k], cell[k + 1]];
            for band in low..=high {
                let mut part = triangle.to_vec();
                if band > low {
                    part = clipped(&part, self.edges[band], 1.0);
                }
                if band < high {
                    part = clipped(&part, self.edges[band + 1], -1.0);
                }
                if part.len() > 2 {
                    regions[band].add(part.iter().map(|corner| corner.place));
                }
            }
        }
    }

    /// Draws the colour bar with its numbers, below `top` (pixels).
    pub(super) fn bar(&self, area: &Area<'_>, style: Style, name: &str, top: i32) -> Fallible<()> {
        const LEFT: i32 = 80;
        let width = style.width();
        let count = self.count() as i32;
        let each = (width - 2 * LEFT) / count;
        let left = (width - count * each) / 2;
        let edge = |k: i32| px(left + k * each);
        let centred = |y: i32, x: i32, words: &str, size: i32, v: VPos| {
            let text = page::text(style, size).pos(Pos::new(HPos::Center, v));
            area.draw(&Text::new(words.to_owned(), (x, px(y)), text))
        };
        let axis = style.palette().axis.stroke_width(px(1) as u32);
        centred(top + 10, px(width / 2), name, page::LETTERS, VPos::Center)?;
        let (upper, lower) = (px(top + 24), px(top + 40));
        for k in 0..count {
            let colour = self.colour(k as usize).filled();
            area.draw(&Rectangle::new(
                [(edge(k), upper), (edge(k + 1), lower)],
                colour,
            ))?;
        }
        area.draw(&Rectangle::new(
            [(edge(0), upper), (edge(count), lower)],
            axis,
        ))?;
        // every number, or every other one if they would touch
        let labels: Vec<String> = self.edges.iter().map(|edge| number(*edge)).collect();
        let widest = labels.iter().map(|l| page::width(l)).max().unwrap_or(0);
        let stride = (widest + 8 + each - 1) / each.max(1);
        for (k, label) in (0..).zip(&labels) {
            area.draw(&PathElement::new(
                [(edge(k), lower), (edge(k), lower + px(4))],
                axis,
            ))?;
            if k % stride.max(1) == 0 {
                centred(top + 47, edge(k), label, page::LETTERS, VPos::Top)?;
            }
        }
        let beyond = [
            ("min", HPos::Right, edge(0) - px(6)),
            ("max", HPos::Left, edge(count) + px(6)),
        ];
        for ((word, side, x), value) in beyond.into_iter().zip(self.beyond) {
            let Some(value) = value else { continue };
            for (line, text) in [(26, word.to_owned()), (40, rounded(value))] {
                let small = page::text(style, 13).pos(Pos::new(side, VPos::Center));
                area.draw(&Text::new(text, (x, px(top + line)), small))?;
            }
        }
        Ok(())
    }
}

/// A corner of a cell: its place in the figure, and the value there.
#[derive(Clone, Copy, Debug)]
struct Corner {
    place: [f64; 2],
    value: f64,
}

/// An element divided into convex cells, `n` along a side.
fn cut(family: Family, n: usize, at: &dyn Fn([f64; 2]) -> Corner) -> Vec<Vec<Corner>> {
    let part = |i: usize| i as f64 / n as f64;
    let mut cells = Vec::new();
    match family {
        Family::Quad => {
            let place = |i: usize, j: usize| [2.0 * part(i) - 1.0, 2.0 * part(j) - 1.0];
            let grid: Vec<Vec<Corner>> = (0..=n)
                .map(|j| (0..=n).map(|i| at(place(i, j))).collect())
                .collect();
            for j in 0..n {
                for i in 0..n {
                    let (a, b) = (&grid[j], &grid[j + 1]);
                    cells.push(vec![a[i], a[i + 1], b[i + 1], b[i]]);
                }
            }
        }
        Family::Triangle => {
            let grid: Vec<Vec<Corner>> = (0..=n)
                .map(|j| (0..=n - j).map(|i| at([part(i), part(j)])).collect())
                .collect();
            for j in 0..n {
                for i in 0..n - j {
                    let (a, b) = (&grid[j], &grid[j + 1]);
                    cells.push(vec![a[i], a[i + 1], b[i]]);
                    if i + 1 < n - j {
                        cells.push(vec![a[i + 1], b[i + 1], b[i]]);
                    }
                }
            }
        }
    }
    cells
}

/// The part of a polygon where the field is above a level (`side` 1) or below it (−1).
fn clipped(polygon: &[Corner], level: f64, side: f64) -> Vec<Corner> {
    let over = |corner: &Corner| side * (corner.value - level);
    let mut kept = Vec::new();
    for (k, a) in polygon.iter().enumerate() {
        let b = &polygon[(k + 1) % polygon.len()];
        if over(a) >= 0.0 {
            kept.push(*a);
        }
        if (over(a) > 0.0 && over(b) < 0.0) || (over(a) < 0.0 && over(b) > 0.0) {
            let part = over(a) / (over(a) - over(b));
            let mix = |c: usize| a.place[c] + part * (b.place[c] - a.place[c]);
            kept.push(Corner {
                place: [mix(0), mix(1)],
                value: level,
            });
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_end_on_round_numbers_and_a_lone_peak_is_only_a_number() {
        let even: Vec<f64> = (0..=100).map(f64::from).collect();
        let bands = Bands::of(&even, vec![]);
        assert_eq!((bands.count(), bands.beyond), (10, [None, None]));
        assert_eq!(bands.edges[10], 100.0);
        let mut peaked: Vec<f64> = (0..1000).map(|k| f64::from(k) * 0.1).collect();
        peaked[17] = 5000.0;
        let bands = Bands::of(&peaked, peaked.iter().map(|v| (*v, 1.0)).collect());
        assert_eq!(bands.beyond, [None, Some(5000.0)]);
        assert!(*bands.edges.last().unwrap() < 200.0);
        assert_eq!(Bands::of(&[0.0; 4], vec![]).count(), 1);
        assert_eq!(Bands::of(&[], vec![]).count(), 1);
        assert_eq!(Bands::of(&[-7.3; 4], vec![]).count(), 1);
    }

    #[test]
    fn the_parts_of_a_cell_cover_it() {
        let bands = Bands::of(&[0.0, 10.0], vec![]);
        let corner = |x: f64, y: f64| Corner {
            place: [x, y],
            value: 3.0 * x + 6.9 * y,
        };
        let triangle = [corner(0.0, 0.0), corner(1.0, 0.0), corner(0.0, 1.0)];
        let area = |p: &[Corner]| -> f64 {
            (0..p.len())
                .map(|k| {
                    let (a, b) = (p[k].place, p[(k + 1) % p.len()].place);
                    0.5 * (a[0] * b[1] - b[0] * a[1])
                })
                .sum()
        };
        let whole: f64 = (0..bands.count())
            .map(|k| {
                let above = clipped(&triangle, bands.edges[k], 1.0);
                area(&clipped(&above, bands.edges[k + 1], -1.0))
            })
            .sum();
        assert!((whole - 0.5).abs() < 1e-12);
        let cells = cut(Family::Triangle, 4, &|[x, y]| corner(x, y));
        let all: f64 = cells.iter().map(|cell| area(cell)).sum();
        assert!((all - 0.5).abs() < 1e-12);
    }
}

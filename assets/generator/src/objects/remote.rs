//! A remote control, 17 cm long: a rounded body that grows thicker toward the batteries at −Y, buttons raised from its
//! upper side (+Z).
//!
//! One closed surface. Its upper side is a grid of rectangular cells; a button grows out of the middle of its cell.
//! Body and buttons are built flat and then bent, which keeps the surface closed.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};
use grasp_mesh_builder::{MeshBuilder, Ring, Shape, on_rounded_rectangle, sin_cos_degrees};

/// Everything but the buttons.
const BODY: &str = "body";

/// Sides and tops of the buttons.
const BUTTONS: &str = "buttons";

/// Half width and half length of the body before it is tapered, and its corners' radius, in millimetres.
const HALF_SIZE: DVec2 = DVec2::new(25.0, 85.0);
const CORNER_RADIUS: f64 = 13.0;

/// The grid's columns: edges of the cells in millimetres, each cut in three.
const COLUMNS: [f64; 4] = [-18.6, -6.2, 6.2, 18.6];
const CUTS: usize = 3;

/// Parts into which the sides of the pad's row are cut: more than elsewhere, because its circle needs them.
const PAD_CUTS: usize = 5;

/// Cross-sections of the body from top to bottom: how far inside the outline, and z, in millimetres.
const BODY_RINGS: [[f64; 2]; 5] = [[2.2, -0.2], [0.7, -1.2], [0.0, -3.8], [1.8, -15.0], [6.0, -19.0]];

/// The contents of a row of the grid.
enum Row {
    /// A button or nothing for each column.
    Cells([Option<Button>; 3]),
    /// A ring of arrows around a button, as wide as the grid.
    Pad,
    /// Nothing, as wide as the grid.
    Plain,
}

/// A raised button.
#[derive(Clone, Copy)]
struct Button {
    half_size: DVec2,
    radius: f64,
    /// Whether the rim is rounded by another ring of vertices.
    bevelled: bool,
}

const ROUND: Button = Button {
    half_size: DVec2::splat(4.6),
    radius: 4.6,
    bevelled: true,
};
const SMALL: Button = Button {
    half_size: DVec2::new(3.6, 3.6),
    radius: 3.6,
    bevelled: false,
};
const NUMBER: Button = Button {
    half_size: DVec2::new(4.8, 4.1),
    radius: 3.0,
    bevelled: false,
};
const ROCKER: Button = Button {
    half_size: DVec2::new(4.6, 10.5),
    radius: 4.5,
    bevelled: true,
};

/// How far the buttons stand out, in millimetres.
const BUTTON_HEIGHT: f64 = 1.7;

/// The rows from +Y to −Y: their length in millimetres and what is in them.
const ROWS: [(f64, Row); 8] = [
    (16.0, Row::Cells([Some(SMALL), None, Some(ROUND)])),
    (41.0, Row::Pad),
    (27.5, Row::Cells([Some(ROCKER), Some(SMALL), Some(ROCKER)])),
    (14.0, Row::Cells([Some(NUMBER); 3])),
    (14.0, Row::Cells([Some(NUMBER); 3])),
    (14.0, Row::Cells([Some(NUMBER); 3])),
    (14.0, Row::Cells([Some(NUMBER); 3])),
    (17.5, Row::Plain),
];

/// The mesh.
pub(crate) fn build() -> Shape {
    let mut sketch = Sketch {
        mesh: MeshBuilder::new(&[BODY, BUTTONS]),
        grid: BTreeMap::new(),
    };
    let mut top = ROWS.iter().map(|(length, _)| length).sum::<f64>() / 2.0;
    let half_length = top;
    let mut row_edges = vec![top];
    for (length, row) in &ROWS {
        let bottom = top - length;
        match row {
            Row::Cells(cells) => {
                for (column, cell) in cells.iter().enumerate() {
                    let low = DVec2::new(COLUMNS[column], bottom);
                    let high = DVec2::new(COLUMNS[column + 1], top);
                    sketch.cell(low, high, *cell);
                }
                row_edges.extend((1..=CUTS).map(|cut| top - length * cut as f64 / CUTS as f64));
            }
            Row::Pad => {
                sketch.pad(bottom, top);
                row_edges.extend((1..=PAD_CUTS).map(|cut| top - length * cut as f64 / PAD_CUTS as f64));
            }
            Row::Plain => {
                sketch.plain(bottom, top);
                row_edges.extend((1..=CUTS).map(|cut| top - length * cut as f64 / CUTS as f64));
            }
        }
        top = bottom;
    }
    sketch.body(half_length, &row_edges);
    sketch.mesh.finish()
}

/// The flat mesh and the vertices of its grid.
struct Sketch {
    mesh: MeshBuilder,
    /// Vertices by x and y in whole micrometres, so that neighbouring cells share them.
    grid: BTreeMap<[i64; 2], usize>,
}

impl Sketch {
    /// Adds a vertex, bent as the whole remote is.
    fn vertex(&mut self, point: DVec2, z: f64) -> usize {
        self.mesh.vertex(bend(point.extend(z)))
    }

    /// The vertex of the grid at a point of the flat upper side.
    fn grid_vertex(&mut self, point: DVec2) -> usize {
        let key = (point * 1000.0)
            .to_array()
            .map(|coordinate| coordinate.round() as i64);
        if let Some(&vertex) = self.grid.get(&key) {
            return vertex;
        }
        let vertex = self.vertex(point, 0.0);
        self.grid.insert(key, vertex);
        vertex
    }

    /// Vertices for the points of a closed curve at one height.
    fn level(&mut self, points: &[DVec2], z: f64) -> Ring {
        points.iter().map(|&point| self.vertex(point, z)).collect()
    }

    /// The rim of a cell.
    fn rim(&mut self, points: &[DVec2]) -> Ring {
        points.iter().map(|&point| self.grid_vertex(point)).collect()
    }

    /// A cell with a button, or a plain one.
    fn cell(&mut self, low: DVec2, high: DVec2, button: Option<Button>) {
        let points = rectangle_points(low, high, [CUTS, CUTS]);
        let rim = self.rim(&points);
        let centre = (low + high) / 2.0;
        let Some(button) = button else {
            let middle = self.vertex(centre, 0.0);
            self.mesh.fan(&rim, middle, |_| BODY);
            return;
        };
        let outline = |inset: f64| -> Vec<DVec2> {
            points
                .iter()
                .map(|&point| {
                    let half_size = button.half_size - DVec2::splat(inset);
                    // Stretched so that the cell's corners come to lie in the middle of the button's.
                    let stretched = (point - centre) / ((high - low) / 2.0) * half_size;
                    let radius = (button.radius - inset).min(half_size.min_element() - 1e-3);
                    centre + on_rounded_rectangle(stretched, half_size, radius)
                })
                .collect()
        };
        let mut last = self.level(&outline(0.0), 0.0);
        self.mesh.strip(&rim, &last, |_| Some(BODY));
        let levels: &[[f64; 2]] = if button.bevelled {
            &[[0.25, BUTTON_HEIGHT - 0.5], [0.9, BUTTON_HEIGHT]]
        } else {
            &[[0.5, BUTTON_HEIGHT]]
        };
        for &[inset, z] in levels {
            let next = self.level(&outline(inset), z);
            self.mesh.strip(&last, &next, |_| Some(BUTTONS));
            last = next;
        }
        // The ring starts at a corner; from the middle of a side the cap's bands run straight across.
        last.rotate_left(1);
        self.mesh.cap(BUTTONS, &last);
    }

    /// A ring of arrows around a button.
    fn pad(&mut self, bottom: f64, top: f64) {
        /// Radius and height of the ring's outer wall and rim, its dished inner rim, the gap, and the middle button.
        const LEVELS: [[f64; 2]; 6] = [
            [16.4, 0.0],
            [15.7, 1.7],
            [8.6, 1.2],
            [8.1, 0.3],
            [7.3, 0.3],
            [6.6, 1.8],
        ];
        let low = DVec2::new(COLUMNS[0], bottom);
        let high = DVec2::new(COLUMNS[3], top);
        let centre = (low + high) / 2.0;
        let cuts = [CUTS * (COLUMNS.len() - 1), PAD_CUTS];
        let points = rectangle_points(low, high, cuts);
        let directions = quadrant_directions(cuts);
        let mut last = self.rim(&points);
        for (index, [radius, z]) in LEVELS.into_iter().enumerate() {
            let circle: Vec<DVec2> = directions
                .iter()
                .map(|&direction| centre + direction * radius)
                .collect();
            let next = self.level(&circle, z);
            self.mesh
                .strip(&last, &next, |_| Some(if index == 0 { BODY } else { BUTTONS }));
            last = next;
        }
        self.mesh.cap(BUTTONS, &last);
    }

    /// A plain row: bands from side to side, which spread where their ends are cut finer.
    fn plain(&mut self, bottom: f64, top: f64) {
        let low = DVec2::new(COLUMNS[0], bottom);
        let high = DVec2::new(COLUMNS[3], top);
        let points = rectangle_points(low, high, [CUTS * (COLUMNS.len() - 1), CUTS]);
        let mut rim = self.rim(&points);
        // From the middle of the left side, so that the bands run along y.
        rim.rotate_right(CUTS / 2 + 1);
        self.mesh.cap(BODY, &rim);
    }

    /// Sides and underside: rings that widen from the grid's rim to the outline and close below.
    fn body(&mut self, half_length: f64, row_edges: &[f64]) {
        let xs = column_cuts();
        let right = xs[xs.len() - 1];
        // Clockwise seen from above, that is counter-clockwise about the way down. It starts in the middle of the
        // +Y side, so that the bands of the cap below run across.
        let mut points: Vec<DVec2> = xs.iter().map(|&x| DVec2::new(x, half_length)).collect();
        points.extend(row_edges[1..].iter().map(|&y| DVec2::new(right, y)));
        points.extend(xs.iter().rev().skip(1).map(|&x| DVec2::new(x, -half_length)));
        points.extend(
            row_edges[1..row_edges.len() - 1]
                .iter()
                .rev()
                .map(|&y| DVec2::new(-right, y)),
        );
        points.rotate_left(xs.len() / 2);
        let mut last = self.rim(&points);
        for [inset, z] in BODY_RINGS {
            let half_size = HALF_SIZE - DVec2::splat(inset);
            let outline: Vec<DVec2> = points
                .iter()
                .map(|&point| on_rounded_rectangle(point, half_size, CORNER_RADIUS - inset))
                .collect();
            let next = self.level(&outline, z);
            self.mesh.strip(&last, &next, |_| Some(BODY));
            last = next;
        }
        self.mesh.cap(BODY, &last);
    }
}

/// The x of all vertical lines of the grid.
fn column_cuts() -> Vec<f64> {
    let cells = COLUMNS.len() - 1;
    (0..=cells * CUTS)
        .map(|cut| COLUMNS[0] + (COLUMNS[cells] - COLUMNS[0]) * cut as f64 / (cells * CUTS) as f64)
        .collect()
}

/// Points around a rectangle, counter-clockwise from its lower left corner, its sides cut evenly.
fn rectangle_points(low: DVec2, high: DVec2, cuts: [usize; 2]) -> Vec<DVec2> {
    let corners = [low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)];
    (0..4)
        .flat_map(|side| {
            let (from, to) = (corners[side], corners[(side + 1) % 4]);
            let cuts = cuts[side % 2];
            (0..cuts).map(move |cut| from + (to - from) * (cut as f64 / cuts as f64))
        })
        .collect()
}

/// Unit vectors that belong to [`rectangle_points`]: each side of the rectangle takes a quarter of the circle.
fn quadrant_directions(cuts: [usize; 2]) -> Vec<DVec2> {
    (0..4)
        .flat_map(|side| {
            let cuts = cuts[side % 2];
            (0..cuts).map(move |cut| {
                let degrees = 225.0 + 90.0 * (side as f64 + cut as f64 / cuts as f64);
                let (sine, cosine) = sin_cos_degrees(degrees);
                DVec2::new(cosine, sine)
            })
        })
        .collect()
}

/// Bends the flat sketch: narrower and thinner toward +Y, the upper side slightly domed.
fn bend(flat: DVec3) -> DVec3 {
    let along = flat.y / HALF_SIZE.y;
    let across = flat.x / HALF_SIZE.x;
    let toward_tip = 0.5 * (1.0 + along);
    let width = 1.0 - 0.09 * toward_tip;
    // Only what lies below the upper side grows thinner.
    let depth = if flat.z < 0.0 {
        1.0 - 0.22 * toward_tip
    } else {
        1.0
    };
    let dome = -0.7 * across * across - 1.1 * along * along;
    DVec3::new(flat.x * width, flat.y, flat.z * depth + dome)
}

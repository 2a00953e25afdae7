//! Reads a picture as a viewer would.

use std::ops::Range;

use grasp_experiment::plot::Colour;
use roxmltree::{Document, Node};

/// The legend's squares' side, in the picture's units; no bar of the tests is a square of that size.
const SQUARE: f64 = 100.0;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Dot {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) colour: Colour,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bar {
    pub(crate) left: f64,
    pub(crate) top: f64,
    pub(crate) width: f64,
    pub(crate) height: f64,
    pub(crate) colour: Colour,
}

impl Bar {
    pub(crate) fn right(&self) -> f64 {
        self.left + self.width
    }

    pub(crate) fn bottom(&self) -> f64 {
        self.top + self.height
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Words {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) text: String,
    /// What the text about covers, if its letters are half as wide as they are high.
    pub(crate) across: Range<f64>,
    pub(crate) upright: Range<f64>,
}

/// Everything in the order in which it is drawn, in units of which ten make a pixel.
#[derive(Debug, Default)]
pub(crate) struct Picture {
    pub(crate) width: f64,
    pub(crate) height: f64,
    pub(crate) dots: Vec<Dot>,
    pub(crate) bars: Vec<Bar>,
    pub(crate) squares: Vec<Bar>,
    pub(crate) words: Vec<Words>,
    /// Ends of lines.
    pub(crate) points: Vec<(f64, f64)>,
}

impl Picture {
    pub(crate) fn read(svg: &str) -> Self {
        let document = Document::parse(svg).expect("well-formed XML");
        let root = document.root_element();
        let view: Vec<f64> = root
            .attribute("viewBox")
            .unwrap()
            .split(' ')
            .map(|word| word.parse().unwrap())
            .collect();
        let mut picture = Self {
            width: view[2],
            height: view[3],
            ..Self::default()
        };
        assert_eq!((view[0], view[1]), (0.0, 0.0));
        assert_eq!(
            (number(root, "width") * 10.0, number(root, "height") * 10.0),
            (view[2], view[3])
        );
        for node in root.descendants().filter(Node::is_element) {
            picture.take(node);
        }
        picture
    }

    fn take(&mut self, node: Node<'_, '_>) {
        match node.tag_name().name() {
            "circle" => {
                let dot = Dot {
                    x: number(node, "cx"),
                    y: number(node, "cy"),
                    colour: colour(node, "fill"),
                };
                assert!(number(node, "r") > 0.0);
                self.dots.push(dot);
            }
            "rect" => {
                let bar = Bar {
                    left: number(node, "x"),
                    top: number(node, "y"),
                    width: number(node, "width"),
                    height: number(node, "height"),
                    colour: colour(node, "fill"),
                };
                if (bar.width, bar.height) == (self.width, self.height) {
                    assert_eq!(bar.colour, Colour(255, 255, 255), "the background");
                } else if (bar.width, bar.height) == (SQUARE, SQUARE) {
                    self.squares.push(bar);
                } else {
                    self.bars.push(bar);
                }
            }
            "polyline" => {
                let points = node.attribute("points").unwrap().split_whitespace();
                self.points.extend(points.map(|point| {
                    let (x, y) = point.split_once(',').unwrap();
                    (x.parse::<f64>().unwrap(), y.parse::<f64>().unwrap())
                }));
            }
            "line" => {
                self.points.push((number(node, "x1"), number(node, "y1")));
                self.points.push((number(node, "x2"), number(node, "y2")));
            }
            "text" => self.words.push(words(node)),
            "svg" | "g" => {}
            other => panic!("a picture of dots, bars, lines and words has no {other}"),
        }
    }

    /// Words that read so.
    pub(crate) fn find(&self, text: &str) -> &Words {
        let found: Vec<_> = self.words.iter().filter(|words| words.text == text).collect();
        assert_eq!(found.len(), 1, "{text:?} among {:?}", self.texts());
        found[0]
    }

    pub(crate) fn texts(&self) -> Vec<&str> {
        self.words.iter().map(|words| words.text.as_str()).collect()
    }

    pub(crate) fn dots_of(&self, colour: Colour) -> Vec<Dot> {
        self.dots
            .iter()
            .copied()
            .filter(|dot| dot.colour == colour)
            .collect()
    }

    pub(crate) fn bars_of(&self, colour: Colour) -> Vec<Bar> {
        self.bars
            .iter()
            .copied()
            .filter(|bar| bar.colour == colour)
            .collect()
    }

    /// Fails if anything lies outside the picture.
    pub(crate) fn assert_all_inside(&self) {
        let inside = |x: f64, y: f64, what: &dyn std::fmt::Debug| {
            assert!(
                (0.0..=self.width).contains(&x) && (0.0..=self.height).contains(&y),
                "{what:?} is outside"
            );
        };
        for dot in &self.dots {
            inside(dot.x, dot.y, dot);
        }
        for bar in self.bars.iter().chain(&self.squares) {
            inside(bar.left, bar.top, bar);
            inside(bar.right(), bar.bottom(), bar);
        }
        for point in &self.points {
            inside(point.0, point.1, point);
        }
        for words in &self.words {
            inside(words.across.start, words.upright.start, words);
            inside(words.across.end, words.upright.end, words);
        }
    }

    /// Fails if words lie on each other.
    pub(crate) fn assert_words_apart(&self) {
        for (index, one) in self.words.iter().enumerate() {
            for other in &self.words[..index] {
                let apart =
                    |one: &Range<f64>, other: &Range<f64>| one.end <= other.start || other.end <= one.start;
                assert!(
                    apart(&one.across, &other.across) || apart(&one.upright, &other.upright),
                    "{one:?} lies on {other:?}"
                );
            }
        }
    }
}

/// An attribute of the element or, where it has none, of the group it is in.
fn inherited<'a>(node: Node<'a, '_>, key: &str) -> Option<&'a str> {
    node.ancestors().find_map(|node| node.attribute(key))
}

fn number(node: Node<'_, '_>, key: &str) -> f64 {
    let value: f64 = node
        .attribute(key)
        .unwrap_or_else(|| panic!("{node:?} has no {key}"))
        .parse()
        .unwrap();
    assert!(value.is_finite());
    value
}

fn colour(node: Node<'_, '_>, key: &str) -> Colour {
    let text = inherited(node, key).unwrap_or_else(|| panic!("{node:?} has no {key}"));
    let channel = |place: usize| u8::from_str_radix(&text[place..place + 2], 16).unwrap();
    assert!(text.starts_with('#'));
    Colour(channel(1), channel(3), channel(5))
}

fn words(node: Node<'_, '_>) -> Words {
    let (x, y) = (number(node, "x"), number(node, "y"));
    let text = node.text().unwrap_or_default().trim().to_owned();
    let size: f64 = inherited(node, "font-size").unwrap().parse().unwrap();
    let long = 0.5 * size * text.chars().count() as f64;
    let start = match inherited(node, "text-anchor") {
        None | Some("start") => 0.0,
        Some("middle") => -long / 2.0,
        Some("end") => -long,
        other => panic!("{other:?}"),
    };
    // The foot of the letters, and as high as capitals are.
    let foot = match node.attribute("dy") {
        Some("0.76em") => 0.76 * size,
        Some("0.5ex") => 0.26 * size,
        Some("-0.5ex") => -0.26 * size,
        other => panic!("{other:?}"),
    };
    let (along, high) = (start..start + long, foot - 0.7 * size..foot);
    let (across, upright) = match node.attribute("transform") {
        None => (x + along.start..x + along.end, y + high.start..y + high.end),
        Some(turn) => {
            // A quarter turn to the left about its own anchor: right becomes up, down becomes right.
            assert_eq!(turn, format!("rotate(270, {x}, {y})"));
            (x + high.start..x + high.end, y - along.end..y - along.start)
        }
    };
    Words {
        x,
        y,
        text,
        across,
        upright,
    }
}

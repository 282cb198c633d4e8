//! What moves at each resonance speed: the axis of tub and drum (the paper's Fig. 8).

use serde_json::Value;
use sweep_files::key;

use sweep_plot::chart::{Chart, ChartPanel, Series, Style};
use sweep_plot::label::{self, Label};
use sweep_plot::table::Table;
use sweep_plot::{DISTINCT, PlotError};

/// Departures of the drum's axis from the tub's are drawn from this share of the greatest
/// deflection on.
const TOGETHER: f64 = 0.02;

/// A deflection that swings, as real and imaginary part.
type Phasor = [f64; 2];

/// Places along the axis, from O towards the door (m).
struct Places {
    /// Rear and front of the tub.
    tub: [f64; 2],
    /// Rear, hinge and front of the drum.
    drum: [f64; 3],
}

/// Deflections of an axis along c2 and c3 at some places.
type Line = [Vec<Phasor>; 2];

/// The chart of a modes file: a panel for each resonance, which shows how far points of the axis
/// are from rest when the greatest deflection is at its farthest, and a quarter of a period later.
///
/// # Errors
/// [`PlotError::Undrawable`] where the file holds no machine or no resonances.
pub(crate) fn chart(table: &Table) -> Result<Chart, PlotError> {
    let places = places(table)
        .ok_or_else(|| table.source.empty("the file does not say where the machine's parts are"))?;
    let mut panels = Vec::new();
    for mode in table.source.list(key::MODES) {
        let name = mode["name"].as_str().unwrap_or_default();
        for resonance in mode["resonances"].as_array().into_iter().flatten() {
            let (Some(speed), Some(q)) =
                (resonance["speed_rpm"].as_f64(), shape(&resonance["shape"]))
            else {
                continue;
            };
            let number = panels.len() + 1;
            let words = format!("{}, {speed:.1} rpm", label::capitalised(name));
            let label = Label::new(&words, "");
            panels.push(ChartPanel {
                range: Some((-1.15, 1.15)),
                height: 200.0,
                ..ChartPanel::new(&format!("shape {number}"), label, series(&places, &q))
            });
        }
    }
    if panels.is_empty() {
        return Err(table
            .source
            .empty("the file holds no resonance; `sweep modes --speed` over faster speeds may"));
    }
    Ok(Chart {
        title: "Mode shapes at the resonance speeds".to_owned(),
        subtitle: table
            .source
            .subtitle("deflection of the axis as a share of the greatest, unbalance up"),
        x_label: Label::new("Place along the drum's axis, towards the door", "m"),
        panels,
        ..Chart::default()
    })
}

fn places(table: &Table) -> Option<Places> {
    let machine = table.source.find("machine")?;
    let number = |path: &str| machine.pointer(path).and_then(Value::as_f64);
    let rear = number("/bearings/rear_x_m")?;
    let tub = [rear, number("/tub/front_x_m")?];
    let drum = [rear, number("/drum/hinge_x_m")?, number("/drum/front_x_m")?];
    Some(Places { tub, drum })
}

/// Coordinates of a shape: `q1` to `q10` of a modes file.
const COORDINATES: usize = 10;

/// One phasor a coordinate.
fn shape(of: &Value) -> Option<Vec<Phasor>> {
    let part = |q: &Value, k: usize| q.get(k).and_then(Value::as_f64);
    (1..=COORDINATES)
        .map(|i| of.get(format!("q{i}")).and_then(|q| Some([part(q, 0)?, part(q, 1)?])))
        .collect()
}

/// Tub and drum along their axes to first order (model page, section 1).
fn lines(places: &Places, q: &[Phasor]) -> [Line; 2] {
    let plus = |a: Phasor, k: f64, b: Phasor| [a[0] + k * b[0], a[1] + k * b[1]];
    let straight = |start: Phasor, slope: Phasor, sign: f64, xs: &[f64]| -> Vec<Phasor> {
        xs.iter().map(|x| plus(start, sign * x, slope)).collect()
    };
    let Places { tub, drum } = places;
    let tub = [straight(q[0], q[5], 1.0, tub), straight(q[1], q[4], -1.0, tub)];
    let mut drum = [straight(q[2], q[7], 1.0, drum), straight(q[3], q[6], -1.0, drum)];
    // Beyond the hinge the drum bends away; at theta = 0 its angles are about c2 and c3 too.
    let beyond = places.drum[2] - places.drum[1];
    drum[0][2] = plus(drum[0][2], beyond, q[9]);
    drum[1][2] = plus(drum[1][2], -beyond, q[8]);
    [tub, drum]
}

fn series(places: &Places, q: &[Phasor]) -> Vec<Series> {
    let [tub, drum] = lines(places, q);
    let squared = |[re, im]: Phasor| re * re + im * im;
    let all = tub.iter().chain(&drum).flatten();
    let greatest =
        all.copied().max_by(|a, b| squared(*a).total_cmp(&squared(*b))).unwrap_or([1.0, 0.0]);
    // Divided by the greatest deflection, which is then 1 at its farthest.
    let scale = squared(greatest);
    let turned = |[re, im]: Phasor| {
        [
            (re * greatest[0] + im * greatest[1]) / scale,
            (im * greatest[0] - re * greatest[1]) / scale,
        ]
    };
    let mut series = Vec::new();
    for (k, direction) in ["vertical", "horizontal"].into_iter().enumerate() {
        let tub_line: Vec<Phasor> = tub[k].iter().copied().map(turned).collect();
        let drum_line: Vec<Phasor> = drum[k].iter().copied().map(turned).collect();
        let mut add = |body: &str, x: &[f64], line: &[Phasor], colour: usize| {
            // The real part of exp(i w t); a quarter of a period later, less its imaginary part.
            for (part, sign, style, when) in [
                (0, 1.0, Style::Solid(2.6), ""),
                (1, -1.0, Style::Dashed, ", a quarter of a period later"),
            ] {
                let name = format!("{body}{direction}{when}");
                let y = line.iter().map(|phasor| sign * phasor[part]).collect();
                series.push(Series::new(name, DISTINCT[colour], x.to_vec(), y, style));
            }
        };
        add("", &places.tub, &tub_line, k);
        if apart(places, &tub_line, &drum_line) > TOGETHER {
            add("drum, ", &places.drum, &drum_line, k + 2);
        }
    }
    series
}

/// How far the drum's axis is from the tub's, at most.
fn apart(places: &Places, tub: &[Phasor], drum: &[Phasor]) -> f64 {
    let on_tub = |x: f64| {
        let part = (x - places.tub[0]) / (places.tub[1] - places.tub[0]);
        [0, 1].map(|k| tub[0][k] + part * (tub[1][k] - tub[0][k]))
    };
    let points = places.drum.into_iter().zip(drum);
    let apart = points.map(|(x, at)| (at[0] - on_tub(x)[0]).hypot(at[1] - on_tub(x)[1]));
    apart.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLACES: Places = Places { tub: [-0.05, 0.45], drum: [-0.05, 0.15, 0.45] };

    #[test]
    fn a_pitch_is_a_vertical_tilt_and_a_yaw_a_horizontal_one_against_its_sign() {
        let mut q = vec![[0.0, 0.0]; 10];
        (q[5], q[7]) = ([0.0, 2.0], [0.0, 2.0]);
        let drawn = series(&PLACES, &q);
        assert_eq!(drawn.len(), 4, "tub and drum move alike");
        let of = |name: &str| &drawn.iter().find(|series| series.name == name).unwrap().y;
        let near = |found: &[f64], expected: [f64; 2]| {
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
        };
        near(of("vertical"), [-0.05 / 0.45, 1.0]);
        near(of("horizontal"), [0.0, 0.0]);
        let mut q = vec![[0.0, 0.0]; 10];
        (q[4], q[6]) = ([1.0, 0.0], [1.0, 0.0]);
        let drawn = series(&PLACES, &q);
        near(&drawn[2].y, [-0.05 / 0.45, 1.0]);
    }

    #[test]
    fn what_comes_later_is_drawn_later_and_a_bent_drum_apart() {
        // Along c3 a quarter of a period before c2: c2 is at its farthest when c3 is back at rest.
        let mut q = vec![[0.0, 0.0]; 10];
        (q[0], q[2]) = ([0.0, -1.0], [0.0, -1.0]);
        (q[1], q[3]) = ([0.5, 0.0], [0.5, 0.0]);
        q[9] = [0.0, -0.5 / 0.3];
        let drawn = series(&PLACES, &q);
        let of = |name: &str| &drawn.iter().find(|series| series.name == name).unwrap().y;
        // The greatest is the drum's front, 1.5 along c2.
        let last = |name: &str| of(name).last().copied().unwrap();
        assert!((last("drum, vertical") - 1.0).abs() < 1e-12);
        assert!((last("vertical") - 1.0 / 1.5).abs() < 1e-12);
        assert!((last("horizontal, a quarter of a period later") + 0.5 / 1.5).abs() < 1e-12);
        assert!(last("horizontal").abs() < 1e-12);
    }
}

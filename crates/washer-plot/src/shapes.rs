//! Mode shapes: the axes of tub and drum at each resonance speed (the paper's Fig. 8).

use serde_json::Value;
use sweep_files::key;

use sweep_plot::chart::{Chart, ChartPanel, Series, SeriesStyle};
use sweep_plot::label::{self, Label};
use sweep_plot::table::FigureTable;
use sweep_plot::{DISTINCT_COLOURS, PlotError};

/// Minimum separation of the drum's axis from the tub's that is drawn, relative to the greatest
/// deflection. Basis: smaller ones cannot be seen. Doubling it hides slight bending.
const MIN_SEPARATION: f64 = 0.02;

/// An oscillating deflection by its real and imaginary part.
type Phasor = [f64; 2];

/// Positions along the axis, from O towards the door (m).
struct AxisPositions {
    /// The rear and the front of the tub.
    tub_x_m: [f64; 2],
    /// The rear, the hinge and the front of the drum.
    drum_x_m: [f64; 3],
}

/// The deflections of an axis along c2 and c3 at some positions.
type AxisShape = [Vec<Phasor>; 2];

/// Draws the shapes of a modes file: a panel for each resonance, with the deflection of the axis at
/// the instant of the greatest deflection and a quarter of a period later.
///
/// # Errors
/// [`PlotError::Undrawable`] if the file has no machine or no resonances.
pub(crate) fn shape_chart(table: &FigureTable) -> Result<Chart, PlotError> {
    let positions = axis_positions(table).ok_or_else(|| {
        table.source.nothing_to_draw_error("the file does not say where the machine's parts are")
    })?;
    let mut panels = Vec::new();
    for mode in table.source.metadata_list(key::MODES) {
        let name = mode["name"].as_str().unwrap_or_default();
        for resonance in mode["resonances"].as_array().into_iter().flatten() {
            let (Some(speed), Some(coordinates)) =
                (resonance["speed_rpm"].as_f64(), coordinate_phasors(&resonance["shape"]))
            else {
                continue;
            };
            let panel_number = panels.len() + 1;
            let label_words = format!("{}, {speed:.1} rpm", label::capitalise(name));
            let label = Label::new(&label_words, "");
            panels.push(ChartPanel {
                y_range: Some((-1.15, 1.15)),
                height: 200.0,
                ..ChartPanel::new(
                    &format!("shape {panel_number}"),
                    label,
                    shape_series(&positions, &coordinates),
                )
            });
        }
    }
    if panels.is_empty() {
        return Err(table.source.nothing_to_draw_error(
            "the file holds no resonance; `sweep modes --speed` over faster speeds may",
        ));
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

fn axis_positions(table: &FigureTable) -> Option<AxisPositions> {
    let machine = table.source.find_metadata("machine")?;
    let read_number = |path: &str| machine.pointer(path).and_then(Value::as_f64);
    let rear_x_m = read_number("/bearings/rear_x_m")?;
    let tub_x_m = [rear_x_m, read_number("/tub/front_x_m")?];
    let drum_x_m = [rear_x_m, read_number("/drum/hinge_x_m")?, read_number("/drum/front_x_m")?];
    Some(AxisPositions { tub_x_m, drum_x_m })
}

/// Number of coordinates of a shape: `q1` to `q10` of a modes file.
const COORDINATE_COUNT: usize = 10;

/// Returns the phasor of each coordinate.
fn coordinate_phasors(coordinates: &Value) -> Option<Vec<Phasor>> {
    let read_component = |number_pair: &Value, k: usize| number_pair.get(k).and_then(Value::as_f64);
    (1..=COORDINATE_COUNT)
        .map(|i| {
            coordinates.get(format!("q{i}")).and_then(|number_pair| {
                Some([read_component(number_pair, 0)?, read_component(number_pair, 1)?])
            })
        })
        .collect()
}

/// Returns the axes of tub and drum to first order (model page, section 1).
fn axis_shapes(positions: &AxisPositions, phasors: &[Phasor]) -> [AxisShape; 2] {
    let add_scaled = |a: Phasor, k: f64, b: Phasor| [a[0] + k * b[0], a[1] + k * b[1]];
    let straight_axis = |start: Phasor, slope: Phasor, sign: f64, xs: &[f64]| -> Vec<Phasor> {
        xs.iter().map(|x| add_scaled(start, sign * x, slope)).collect()
    };
    let AxisPositions { tub_x_m, drum_x_m } = positions;
    let tub = [
        straight_axis(phasors[0], phasors[5], 1.0, tub_x_m),
        straight_axis(phasors[1], phasors[4], -1.0, tub_x_m),
    ];
    let mut drum = [
        straight_axis(phasors[2], phasors[7], 1.0, drum_x_m),
        straight_axis(phasors[3], phasors[6], -1.0, drum_x_m),
    ];
    // Beyond the hinge the drum's axis is bent against the shaft; at theta = 0 its angles are about
    // c2 and c3.
    let length_beyond_hinge = positions.drum_x_m[2] - positions.drum_x_m[1];
    drum[0][2] = add_scaled(drum[0][2], length_beyond_hinge, phasors[9]);
    drum[1][2] = add_scaled(drum[1][2], -length_beyond_hinge, phasors[8]);
    [tub, drum]
}

fn shape_series(positions: &AxisPositions, phasors: &[Phasor]) -> Vec<Series> {
    let [tub, drum] = axis_shapes(positions, phasors);
    let squared_magnitude = |[real, imaginary]: Phasor| real * real + imaginary * imaginary;
    let deflections = tub.iter().chain(&drum).flatten();
    let greatest_magnitude = deflections
        .copied()
        .max_by(|a, b| squared_magnitude(*a).total_cmp(&squared_magnitude(*b)))
        .unwrap_or([1.0, 0.0]);
    // Division by the greatest deflection makes that 1 at its maximum.
    let scale = squared_magnitude(greatest_magnitude);
    let normalise = |[real, imaginary]: Phasor| {
        [
            (real * greatest_magnitude[0] + imaginary * greatest_magnitude[1]) / scale,
            (imaginary * greatest_magnitude[0] - real * greatest_magnitude[1]) / scale,
        ]
    };
    let mut series = Vec::new();
    for (k, direction) in ["vertical", "horizontal"].into_iter().enumerate() {
        let tub_curve: Vec<Phasor> = tub[k].iter().copied().map(normalise).collect();
        let drum_curve: Vec<Phasor> = drum[k].iter().copied().map(normalise).collect();
        let mut add_real_and_imaginary = |body: &str, x: &[f64], line: &[Phasor], colour: usize| {
            // The real part of exp(i w t) comes first; a quarter of a period later it is minus the
            // imaginary part.
            for (component, sign, style, suffix) in [
                (0, 1.0, SeriesStyle::Solid(2.6), ""),
                (1, -1.0, SeriesStyle::Dashed, ", a quarter of a period later"),
            ] {
                let name = format!("{body}{direction}{suffix}");
                let y = line.iter().map(|phasor| sign * phasor[component]).collect();
                series.push(Series::new(name, DISTINCT_COLOURS[colour], x.to_vec(), y, style));
            }
        };
        add_real_and_imaginary("", &positions.tub_x_m, &tub_curve, k);
        if max_separation(positions, &tub_curve, &drum_curve) > MIN_SEPARATION {
            add_real_and_imaginary("drum, ", &positions.drum_x_m, &drum_curve, k + 2);
        }
    }
    series
}

/// Returns the greatest distance between the axes of drum and tub.
fn max_separation(positions: &AxisPositions, tub: &[Phasor], drum: &[Phasor]) -> f64 {
    let tub_deflection = |x: f64| {
        let fraction = (x - positions.tub_x_m[0]) / (positions.tub_x_m[1] - positions.tub_x_m[0]);
        [0, 1].map(|k| tub[0][k] + fraction * (tub[1][k] - tub[0][k]))
    };
    let deflected_points = positions.drum_x_m.into_iter().zip(drum);
    let separations = deflected_points.map(|(x, deflection)| {
        (deflection[0] - tub_deflection(x)[0]).hypot(deflection[1] - tub_deflection(x)[1])
    });
    separations.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    const POSITIONS: AxisPositions =
        AxisPositions { tub_x_m: [-0.05, 0.45], drum_x_m: [-0.05, 0.15, 0.45] };

    #[test]
    fn pitch_tilts_the_axis_up_and_yaw_tilts_it_against_c3() {
        let mut phasors = vec![[0.0, 0.0]; 10];
        (phasors[5], phasors[7]) = ([0.0, 2.0], [0.0, 2.0]);
        let series = shape_series(&POSITIONS, &phasors);
        assert_eq!(series.len(), 4, "tub and drum move alike");
        let find_curve = |name: &str| &series.iter().find(|series| series.name == name).unwrap().y;
        let assert_near = |values: &[f64], expected: [f64; 2]| {
            assert!(values.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{values:?}");
        };
        assert_near(find_curve("vertical"), [-0.05 / 0.45, 1.0]);
        assert_near(find_curve("horizontal"), [0.0, 0.0]);
        let mut phasors = vec![[0.0, 0.0]; 10];
        (phasors[4], phasors[6]) = ([1.0, 0.0], [1.0, 0.0]);
        let series = shape_series(&POSITIONS, &phasors);
        assert_near(&series[2].y, [-0.05 / 0.45, 1.0]);
    }

    #[test]
    fn phase_and_bending_of_the_drum_are_drawn() {
        // The motion along c3 leads that along c2 by a quarter of a period.
        let mut phasors = vec![[0.0, 0.0]; 10];
        (phasors[0], phasors[2]) = ([0.0, -1.0], [0.0, -1.0]);
        (phasors[1], phasors[3]) = ([0.5, 0.0], [0.5, 0.0]);
        phasors[9] = [0.0, -0.5 / 0.3];
        let series = shape_series(&POSITIONS, &phasors);
        let find_curve = |name: &str| &series.iter().find(|series| series.name == name).unwrap().y;
        // The greatest deflection is that of the drum's front, 1.5 along c2.
        let last_point = |name: &str| find_curve(name).last().copied().unwrap();
        assert!((last_point("drum, vertical") - 1.0).abs() < 1e-12);
        assert!((last_point("vertical") - 1.0 / 1.5).abs() < 1e-12);
        assert!((last_point("horizontal, a quarter of a period later") + 0.5 / 1.5).abs() < 1e-12);
        assert!(last_point("horizontal").abs() < 1e-12);
    }
}

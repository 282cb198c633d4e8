//! Tests of figures of designs.

use super::super::sample::SampleFile;
use super::super::*;
use super::{draw, draw_svg, error_message, options_for_column, page_data};

/// Returns points whose ratio is 4 where the mass exceeds a half, for any damping; the last row
/// failed and the one before it is undefined.
pub(super) fn design(count: u32) -> SampleFile {
    points_with(count, |sample| sample)
}

/// Returns the points of [`points`] with further parameters.
fn points_with(count: u32, add_parameters: impl Fn(SampleFile) -> SampleFile) -> SampleFile {
    let fraction = |k: u32, step: f64| (f64::from(k) * step).fract();
    let mass: Vec<f64> = (0..count).map(|k| fraction(k, 0.618_033_988_749_895)).collect();
    let damping = (0..count).map(|k| 60.0 + 240.0 * fraction(k, 0.414_213_562_373_095));
    let has_no_result = |k: usize| k + 2 >= count as usize;
    let ratio =
        |k: usize| (!has_no_result(k)).then(|| if mass[k] > 0.5 { 4.0 } else { 1.0 + mass[k] });
    let column = |value: &dyn Fn(usize) -> Option<f64>| -> Vec<f64> {
        (0..count as usize).map(|k| value(k).unwrap_or(f64::NAN)).collect()
    };
    let plan = r#"{
        "name": "sample", "reliability": { "ratio_limit": 2.0 },
        "design": { "method": "monte_carlo", "points": 0, "seed": 0 }
    }"#;
    let parameters = SampleFile::default()
        .counts("point", 0..u64::from(count))
        .numbers("unbalance_mass_kg", "kg", mass.iter().copied())
        .numbers("damping_n_s_per_m", "N s/m", damping)
        .numbers("gravity_m_per_s2", "m/s^2", mass.iter().map(|_| 9.81));
    add_parameters(parameters)
        .numbers("nonlinear_body_yaw", "rad", column(&|k| Some(0.01 * ratio(k)?)))
        .numbers("linear_body_yaw", "rad", column(&|k| ratio(k).map(|_| 0.01)))
        .numbers("ratio_body_yaw", "1", column(&ratio))
        .numbers("ratio_max", "1", column(&ratio))
        .flags("reliable", (0..count as usize).map(|k| ratio(k).map(|ratio| ratio < 2.0)))
        .numbers(
            "min_gap_nonlinear_m",
            "m",
            column(&|k| ratio(k).map(|ratio| 0.003 - 0.001 * ratio)),
        )
        .with_worse("less", Some(0.0))
        .words("status", (0..count).map(|k| Some(if k + 1 == count { "diverged" } else { "ok" })))
        .with_metadata("sweep.plan", plan)
}

/// Returns random points, none of which has a result.
pub(super) fn failed_design(count: u32) -> SampleFile {
    let missing_values = || (0..count).map(|_| f64::NAN);
    let plan = r#"{
        "name": "sample", "reliability": { "ratio_limit": 2.0 },
        "design": { "method": "monte_carlo", "points": 0, "seed": 0 }
    }"#;
    let fractions = |step: f64| (0..count).map(move |k| (f64::from(k) * step).fract());
    SampleFile::default()
        .counts("point", 0..u64::from(count))
        .numbers("unbalance_mass_kg", "kg", fractions(0.618_033_988_749_895))
        .numbers("damping_n_s_per_m", "N s/m", fractions(0.414_213_562_373_095))
        .numbers("nonlinear_body_yaw", "rad", missing_values())
        .numbers("linear_body_yaw", "rad", missing_values())
        .numbers("ratio_body_yaw", "1", missing_values())
        .numbers("ratio_max", "1", missing_values())
        .flags("reliable", (0..count).map(|_| None))
        .numbers("min_gap_nonlinear_m", "m", missing_values())
        .with_worse("less", Some(0.0))
        .words("status", (0..count).map(|_| Some("diverged")))
        .with_metadata("sweep.plan", plan)
}

fn options_for_view(view: DesignView) -> PlotOptions {
    PlotOptions { view: Some(view), ..PlotOptions::default() }
}

/// Counts the texts of a picture that are exactly this text.
fn count_texts(figure: &str, text: &str) -> usize {
    figure.matches(&format!(">{text}<")).count()
}

#[test]
fn a_design_has_a_panel_for_each_pair_and_a_legend() {
    let figure = draw_svg(design(202), &PlotOptions::default());
    for phrase in [
        "Where the linear model can be trusted",
        "sample · 202 points at random",
        "Damping (N s/m)",
        "Greatest ratio",
        "boundary: ratio 2",
        "undefined: no excitation (1)",
        "failed: no result (1)",
    ] {
        assert!(figure.contains(&format!(">{phrase}<")), "{phrase}");
    }
    assert_eq!(count_texts(&figure, "Unbalance mass (kg)"), 1);
    assert!(!figure.contains("Gravity"), "what is the same at every point is no axis");
    let count_on_side = |side: &str| {
        let count_start = figure.find(side).unwrap() + side.len();
        figure[count_start..count_start + 5]
            .split(['(', ')'])
            .nth(1)
            .unwrap()
            .parse::<u32>()
            .unwrap()
    };
    assert_eq!(
        count_on_side(">reliable: below 2 ") + count_on_side(">unreliable: ratio 2 or more "),
        200
    );
}

/// Returns a design of five parameters with long names and numbers of five digits.
fn long_numbers() -> SampleFile {
    let spread_values = |from: f64, to: f64, step: f64| {
        (0..80).map(move |k| from + (to - from) * (f64::from(k) * step).fract())
    };
    points_with(80, |sample| {
        sample
            .numbers("spring_stiffness_n_per_m", "N/m", spread_values(5000.0, 12000.0, 0.732))
            .numbers(
                "flexure_stiffness_n_m_per_rad",
                "N m/rad",
                spread_values(15000.0, 30000.0, 0.236),
            )
            .numbers("body_inertia_11_kg_m2", "kg m^2", spread_values(0.8, 1.6, 0.141))
    })
}

/// Returns the horizontal centred texts of a picture: position, size and text.
fn centred_texts(figure: &str) -> Vec<([f64; 2], f64, String)> {
    let read_attribute = |text: &str, name: &str| {
        let (_, rest) = text.split_once(&format!(" {name}=\""))?;
        rest.split('"').next()?.parse::<f64>().ok()
    };
    let texts = figure.split("<text").skip(1).filter_map(|text| {
        let (tag, rest) = text.split_once('>')?;
        let is_plain = tag.contains("middle") && !tag.contains("rotate");
        let position = [read_attribute(tag, "x")?, read_attribute(tag, "y")?];
        is_plain.then_some((
            position,
            read_attribute(tag, "font-size")?,
            rest.split('<').next()?.to_owned(),
        ))
    });
    texts.collect()
}

#[test]
fn numbers_below_neighbouring_panels_do_not_touch() {
    let figure = draw_svg(long_numbers(), &PlotOptions::default());
    let texts = centred_texts(&figure);
    let numbers: Vec<_> = texts.iter().filter(|(_, _, text)| text.parse::<f64>().is_ok()).collect();
    assert!(numbers.len() >= 10, "two below each panel: {numbers:?}");
    let mut ends: Vec<_> = numbers
        .iter()
        .map(|([x, _], size, text)| {
            let half_width = raster::text_width(text, *size, false) / 2.0;
            (x - half_width, x + half_width, text)
        })
        .collect();
    ends.sort_by(|a, b| a.0.total_cmp(&b.0));
    for pair in ends.windows(2) {
        assert!(pair[1].0 - pair[0].1 >= 5.9, "{pair:?}");
    }
}

#[test]
fn units_are_not_broken_across_lines() {
    let figure = draw_svg(long_numbers(), &PlotOptions::default());
    for unit in ["(kg m^2)", "(N m/rad)", "(N/m)", "(kg)"] {
        assert!(figure.contains(&format!("{unit}<")), "{unit}");
    }
    let broken_texts = figure.split("<text").skip(1).filter_map(|text| {
        let text = text.split_once('>')?.1.split('<').next()?;
        (text.contains('(') != text.contains(')')).then(|| text.to_owned())
    });
    assert_eq!(broken_texts.collect::<Vec<_>>(), [""; 0]);
}

#[test]
fn a_histogram_states_the_share_and_its_interval() {
    let figure = draw_svg(design(102), &options_for_view(DesignView::Histogram));
    // The values 0.618 k modulo 1 with k below 100 exceed a half 49 times. The interval (Wilson) is
    // calculated by hand.
    assert!(figure.contains("51.0 % of the points reliable"), "{figure}");
    assert!(figure.contains("41.3 to 60.6 % (Wilson)"), "{figure}");
    assert!(figure.contains("1 undefined · 1 failed"), "{figure}");
    let draw_histogram = |column| {
        let options =
            PlotOptions { view: Some(DesignView::Histogram), ..options_for_column(column) };
        draw_svg(design(102), &options)
    };
    let figure_of_gap = draw_histogram("min_gap_nonlinear_m");
    assert!(
        figure_of_gap.contains("51.0 % of the points with least gap 0 mm or more"),
        "{figure_of_gap}"
    );
    assert!(draw_histogram("nonlinear_body_yaw").contains("51.0 % of the points reliable"));
}

#[test]
fn bins_count_every_point_once() {
    let page =
        page_data(&draw(design(102), &options_for_view(DesignView::Histogram), "a.html").unwrap());
    let series = page["histogram"]["chart"]["panels"][0]["series"].as_array().unwrap();
    let percentage_lists = series.iter().map(|series| {
        // Each bin gives two points of the curve.
        let ends = super::decode_curve(series);
        ends.iter().filter(|share| share.is_finite()).sum::<f64>() / 2.0
    });
    let percentages: Vec<f64> = percentage_lists.collect();
    let is_near = |share: f64, expected: f64| (share - expected).abs() < 1e-3;
    assert!(is_near(percentages[0], 51.0) && is_near(percentages[1], 49.0), "{percentages:?}");
}

#[test]
fn the_most_influential_parameter_comes_first() {
    let page =
        page_data(&draw(design(402), &options_for_view(DesignView::Influence), "a.html").unwrap());
    assert_eq!(
        (page["kind"].as_str(), page["first"].as_str()),
        (Some("design"), Some("influence"))
    );
    let figure = draw_svg(design(402), &options_for_view(DesignView::Influence));
    assert_eq!(page["influence"], figure);
    // The number follows the parameter's name.
    let rank_correlation = |name: &str| -> f64 {
        let (_, after) = figure.split_once(&format!(">{name}<")).unwrap();
        after.split('>').find_map(|text| text.split_once('<')?.0.parse().ok()).unwrap()
    };
    // Half of the ratios share the greatest rank.
    assert!(
        rank_correlation("Unbalance mass") > 0.9 && rank_correlation("Damping").abs() < 0.1,
        "{figure}"
    );
    let [mass, damping] = [">Unbalance mass<", ">Damping<"].map(|name| figure.find(name).unwrap());
    assert!(mass < damping);
}

#[test]
fn a_figure_of_influence_names_its_channel() {
    let options = PlotOptions {
        view: Some(DesignView::Influence),
        ..options_for_column("nonlinear_body_yaw")
    };
    let figure = draw_svg(design(102), &options);
    let title = ">What it depends on: amplitude, nonlinear model: body yaw<";
    assert!(figure.contains(title), "{figure}");
}

#[test]
fn many_points_are_all_counted_and_some_are_drawn() {
    let page = page_data(&draw(design(250_002), &PlotOptions::default(), "a.html").unwrap());
    let scatter = &page["scatter"];
    let picture = scatter["picture"].as_str().unwrap();
    let legend_texts = ["reliable: below 2 (", "ratio 2 or more (", "excitation (", "no result ("];
    let count_in_legend = |words: &str| -> u64 {
        let (_, rest) = picture.split_once(words).unwrap();
        rest.split(')').next().unwrap().parse().unwrap()
    };
    assert_eq!(legend_texts.map(count_in_legend).iter().sum::<u64>(), 250_002);
    let drawn_count = scatter["of"].as_array().unwrap().len();
    assert!((3000..5000).contains(&drawn_count), "{drawn_count}");
    assert!(page["subtitle"].as_str().unwrap().contains("picked at random"));
    let svg_bytes = draw(design(250_002), &PlotOptions::default(), "a.svg").unwrap().len();
    assert!(svg_bytes < 2_000_000, "{svg_bytes}");
}

#[test]
fn a_list_of_a_whole_grid_is_drawn_as_a_map() {
    let error = error_message(draw(
        super::super::sample::map_sample(),
        &options_for_view(DesignView::Scatter),
        "a.svg",
    ));
    assert!(error.contains("`--view` is for designs"), "{error}");
    assert!(
        error_message(draw(design(50), &options_for_column("status"), "a.svg"))
            .contains("no number")
    );
    let options_at_1 =
        PlotOptions { fixed_values: vec![("x".to_owned(), 1.0)], ..PlotOptions::default() };
    assert!(error_message(draw(design(50), &options_at_1, "a.svg")).contains("`--at` is for maps"));
    let listed_map = || {
        let plan = r#"{ "design": { "method": "list" } }"#;
        super::super::sample::map_sample().with_metadata("sweep.listed", plan)
    };
    assert!(draw_svg(listed_map(), &PlotOptions::default()).contains("linear model unreliable"));
    assert!(
        draw_svg(listed_map(), &options_for_view(DesignView::Histogram))
            .contains("Share of the points (%)")
    );
}

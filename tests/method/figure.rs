//! Figures: places on the page, the same bytes every time, both formats from one description.

use dimcmc::internals::figures::drawing::{Axis, Errors, Panel, Rect, Reference, ScatterPanel, Series, scatter};

fn table() -> ScatterPanel {
    ScatterPanel {
        x_label: "injected *K* (km/s)".into(),
        y_label: "recovered *K* (km/s)".into(),
        x_range: Some([0.0, 0.2]),
        y_range: Some([0.0, 0.2]),
        references: vec![Reference::Diagonal { label: "recovered = injected".into() }],
        series: vec![Series {
            label: "S/N 1000".into(),
            x: vec![0.05, 0.1, 0.15],
            y: vec![0.05, f64::NAN, 0.15],
            y_errors: Errors::Symmetric(vec![0.01; 3]),
            ..Series::default()
        }],
        ..ScatterPanel::default()
    }
}

#[test]
fn values_are_where_the_axes_say() {
    let frame = Rect { left: 10.0, top: 20.0, width: 100.0, height: 50.0 };
    let panel = Panel { frame, x: Axis::linear("", [-1.0, 1.0]), y: Axis::log("", [1.0, 100.0]) };
    for (values, place) in [([-1.0, 1.0], [10.0, 70.0]), ([0.0, 10.0], [60.0, 45.0]), ([1.0, 100.0], [110.0, 20.0])] {
        let found = panel.place(values[0], values[1]);
        assert!((found[0] - place[0]).abs() < 1e-9 && (found[1] - place[1]).abs() < 1e-9, "{values:?}: {found:?}");
    }
}

#[test]
fn one_description_is_both_files_and_the_same_bytes_twice() {
    let figure = || scatter("recovered", &[table(), table()], 2);
    let (svg, png) = (figure().svg(), figure().png(100.0));
    assert_eq!(svg, figure().svg());
    assert_eq!(png, figure().png(100.0));
    // 180 mm at 100 dpi
    assert_eq!(u32::from_be_bytes(png[16..20].try_into().unwrap()), 709);
    assert!(svg.starts_with("<svg") && svg.contains("width=\"180mm\""));
    for label in ["injected K (km/s)", "recovered K (km/s)", "S/N 1000", "recovered = injected", "0.10"] {
        assert!(svg.contains(&format!("aria-label=\"{label}\"")), "{label}");
    }
    // what is not finite is left out; two panels of two points
    assert_eq!((svg.matches("class=\"point\"").count(), svg.matches("class=\"error-bar\"").count()), (4, 4));
}

//! Text of a configuration: what is missing has its default, and what is wrong is named.

use tautscope_config::{AnyLoop, AxesSettings, Configuration, Dof};
use tautscope_core::Settings;

const DEFAULTS: &str = include_str!("../src/defaults.toml");

fn settings(text: &str) -> Settings {
    let configuration = Configuration::parse(text).unwrap();
    configuration.read().unwrap()
}

fn error(text: &str) -> String {
    let configuration = Configuration::parse(text);
    let made = configuration.and_then(|configuration| configuration.build());
    made.err()
        .unwrap_or_else(|| panic!("{text} is accepted"))
        .to_string()
}

#[test]
fn missing_keys_have_their_defaults() {
    let article = DEFAULTS.replace("[[dof]]", "[ignored]");
    let all: Settings = toml::from_str(&article).unwrap();
    assert_eq!(settings(""), all);
    let mut changed = all;
    changed.law.tip_gain = 3.0;
    changed.camera.camera_from_guide.rotation = [0.1, 0.0, 0.0];
    assert_eq!(
        settings("law.tip_gain = 3.0\ncamera.camera_from_guide.rotation = [0.1, 0.0, 0.0]"),
        changed
    );
}

#[test]
fn a_configuration_with_every_key_is_read() {
    let (before, rest) = DEFAULTS.split_once("[[dof]]").unwrap();
    let (_, after) = rest.split_once("\n[").unwrap();
    let article = format!("{before}[drives]\ncycle = 0.01\n[{after}");
    let loops = [&article, DEFAULTS].map(|text| {
        let configuration = Configuration::parse(text).unwrap();
        configuration.build().unwrap()
    });
    let [AnyLoop::Bands(bands), AnyLoop::Axes(axes)] = loops else {
        panic!("the loop of the bands, and that of [[dof]]");
    };
    assert_eq!((bands.dofs(), axes.dofs()), (3, 1));
}

#[test]
fn degrees_of_freedom_have_names_units_and_defaults() {
    let text = r#"
        [[dof]]
        name = "reach"
        unit = "m"
        width_limit = 0.01
        [[dof]]
        name = "turn"
        width_limit = 2
        gain_limit = 3.0
        [law]
        change_rate = 0.1
        [rotation]
        gain_limit = 4.0
    "#;
    let configuration = Configuration::parse(text).unwrap();
    let found = configuration.dofs().iter();
    let found: Vec<_> = found
        .map(|Dof { name, unit }| (&name[..], &unit[..]))
        .collect();
    assert_eq!(found, [("reach", "m"), ("turn", "rad")]);
    let axes: AxesSettings = configuration.read().unwrap();
    let limits: Vec<_> = axes.dof.iter().map(|dof| dof.gain_limit).collect();
    assert_eq!((limits, axes.law.change_rate), (vec![5.0, 3.0], 0.1));
}

const ONE: &str = "[[dof]]\nname = \"a\"\nwidth_limit = 1.0\n";

#[test]
fn errors_name_the_key() {
    let dof = |keys: &str| format!("{ONE}{keys}");
    let nine: String = (0..9)
        .map(|index| ONE.replace("\"a\"", &format!("\"{index}\"")))
        .collect();
    for (text, words) in [
        ("=".into(), "configuration: "),
        ("profile = \"worst\"".into(), "`worst`"),
        (format!("profile = \"worst\"\n{ONE}"), "`worst`"),
        ("[saftey]".into(), "saftey: unknown key"),
        (dof("[saftey]"), "saftey: unknown key"),
        ("law.tip_gian = 3.0".into(), "law.tip_gian: unknown key"),
        (
            dof("[safety]\nframe_aeg = 1"),
            "safety.frame_aeg: unknown key",
        ),
        (
            "camera.camera_from_guide.rot = 3.0".into(),
            "camera.camera_from_guide.rot: unknown key",
        ),
        ("law = 3".into(), "law: got integer, expected a table"),
        ("law.tip_gain = \"three\"".into(), "tip_gain"),
        ("law.tip_gain = 0.5".into(), "tip_gain: got 0.5"),
        (
            "law.tip_gain = nan".into(),
            "law.tip_gain: got NaN, expected a finite number",
        ),
        (
            "camera.camera_from_guide.rotation = [0.1, inf, 0.0]".into(),
            "camera.camera_from_guide.rotation: got inf",
        ),
        (
            "vision.least_inside = nan".into(),
            "vision.least_inside: got NaN",
        ),
        (
            "control.history = 60".into(),
            "history: got 60, expected at most 1024 control periods",
        ),
        (dof("[control]\nhistory = 2e6"), "history: got 2000000"),
        (
            dof("[control]\nhistory = 0.2"),
            "frame_age: got 0.3, expected at most control.history",
        ),
        (dof("[control]\nperiod = 0.1"), "stall: got 0.1"),
        (dof("range = [-inf, inf]"), "dof.range: got -inf"),
        (dof("[law]\ntip_gain = -1"), "tip_gain: got -1"),
        (dof("[control]\nperiod = 0"), "period: got 0"),
        ("dof = 1".into(), "dof: got integer, expected [[dof]]"),
        ("dof = [1]".into(), "dof: got integer, expected a table"),
        (nine, "1 to 8 degrees of freedom"),
        ("[[dof]]\nname = \"a\"".into(), "width_limit"),
        ("[[dof]]\nwidth_limit = 1".into(), "dof.name: got \"\""),
        (
            ONE.repeat(2),
            "dof.name: got \"a\", expected a name used once",
        ),
        (dof("widht = 3"), "dof.widht: unknown key"),
        (dof("lever = \"long\""), "expected f64"),
        (dof("range = [2, 1]"), "range"),
        (dof("range = [-180, 180]"), "not mm and degrees"),
        (dof("speed = -1"), "speed: got -1"),
        (dof("expected_width = 2"), "expected_width"),
        (dof("gain_limit = 0.5"), "gain"),
        (dof("delta_minus = 1"), "delta"),
        (
            dof("unit = \"mm\""),
            "dof.unit: got \"mm\", expected \"m\" or \"rad\"",
        ),
        (
            dof("[kinematics]\nkind = \"two_planes\""),
            "kinematics.kind: got \"two_planes\", expected \"joints\"",
        ),
        (
            dof("[safety]\nwidth_limit = [1, 1, 1]"),
            "safety.width_limit: not used with [[dof]]",
        ),
    ] {
        let found = error(&text);
        assert!(found.contains(words), "{text}: {found}");
    }
}

#[test]
fn numbers_have_the_ranges_of_python() {
    let dof = |keys: &str| format!("{ONE}{keys}");
    for (text, words) in [
        (
            "vision.fit.edge_deviation = -1.0".into(),
            "vision.fit.edge_deviation: got -1, expected 0.0167 to 15, or named in safety.unusual",
        ),
        (
            "control.history = 2e6".into(),
            "control.history: got 2000000, expected 0.0667 to 60",
        ),
        (
            "safety.width_limit = [12.0, 2.6, 1.5]".into(),
            "safety.width_limit: got 12, expected 0.0004 to 0.36, or named in safety.unusual",
        ),
        (
            "safety.command_travel = [[-0.1, 0.3], [-12.6, 722], [-4, 4]]".into(),
            "safety.command_travel: got 722, expected -378 to 378",
        ),
        (
            "safety.good_frames = 151".into(),
            "safety.good_frames: got 151",
        ),
        (
            "camera.cx = 285e3".into(),
            "camera.cx: got 285000, expected -8192 to 16384",
        ),
        (
            "safety.unusual = [\"safety.stal\"]".into(),
            "safety.unusual: got \"safety.stal\"",
        ),
        (dof("lever = 101"), "dof.lever: got 101, expected 0 to 100"),
        (dof("[safety]\nstall = 1e4"), "safety.stall: got 10000"),
    ] {
        let found = error(&text);
        assert!(found.contains(words), "{text}: {found}");
    }
}

#[test]
fn an_unusual_number_is_allowed_by_name() {
    let stall = "[safety]\nunusual = [\"safety.stall\"]\nstall = 1e4";
    assert!(Configuration::parse(stall).is_ok());
    let nan = stall.replace("1e4", "nan");
    assert!(error(&nan).contains("safety.stall: got NaN"));
}

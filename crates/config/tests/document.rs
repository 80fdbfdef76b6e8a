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
        gain_limit = 5.0
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

/// Each text is refused with these words.
fn check_errors(all: &[(String, &str)]) {
    for (text, words) in all {
        let found = error(text);
        assert!(found.contains(words), "{text}: {found}");
    }
}

#[test]
fn errors_name_the_key() {
    let dof = |keys: &str| format!("{ONE}{keys}");
    check_errors(&[
        ("=".into(), "configuration: "),
        (
            "profile = \"worst\"".into(),
            "profile: unknown variant `worst`",
        ),
        (format!("profile = \"worst\"\n{ONE}"), "profile: unknown"),
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
        (
            "camera.source.options = 3".into(),
            "camera.source.options: got integer, expected a table",
        ),
        (
            "law.tip_gain = \"three\"".into(),
            "law.tip_gain: got \"three\", expected a number",
        ),
        (
            "safety.off = [\"fozen\"]".into(),
            "safety.off: unknown variant `fozen`",
        ),
        ("law.tip_gain = 0.5".into(), "law.tip_gain: got 0.5"),
        (
            "law.tip_gain = nan".into(),
            "law.tip_gain: got NaN, expected a finite number",
        ),
        (
            "camera.camera_from_guide.rotation = [0.1, inf, 0.0]".into(),
            "camera.camera_from_guide.rotation[1]: got inf",
        ),
        (
            "vision.least_inside = nan".into(),
            "vision.least_inside: got NaN",
        ),
        (
            "control.period = 0.001".into(),
            "control.history: got 2, expected at most 1024 control periods",
        ),
        (
            dof("[control]\nperiod = 0.001"),
            "control.history: got 2, expected at most 1024 control periods",
        ),
        (
            dof("[control]\nhistory = 0.2"),
            "safety.frame_age: got 0.3, expected at most control.history",
        ),
        (dof("[control]\nperiod = 0.1"), "safety.stall: got 0.1"),
        (dof("[control]\nperiod = 0"), "control.period: got 0"),
        (
            "rotation.delta_plus = -1.0".into(),
            "rotation.delta_minus: got 0, expected at most delta_plus",
        ),
        (
            "rotation.free_gain = 6.0".into(),
            "rotation.free_gain: got 6, expected at least 1, at most gain_limit",
        ),
        (
            "bending.smoothing_factor = 1.0".into(),
            "bending.smoothing_factor: got 1",
        ),
        (
            "safety.unusual = [\"rotation.expected_width\"]\nrotation.expected_width = 0".into(),
            "rotation.expected_width: got 0, expected above 0",
        ),
        (
            "safety.unusual = [\"rotation.start_deviation\"]\nrotation.start_deviation = 0".into(),
            "rotation.start_deviation: got 0",
        ),
        (
            "safety.unusual = [\"safety.width_limit\"]\nsafety.width_limit = [0.01, -2.6, 1.5]"
                .into(),
            "safety.width_limit[1]: got -2.6",
        ),
        (
            "safety.command_travel = [[0, 0.2], [0, -1], [-4, 4]]".into(),
            "safety.command_travel[1]: got [0, -1], expected the lower limit, then the upper",
        ),
    ]);
}

#[test]
fn errors_of_initial_offsets_name_their_limits() {
    let one = |keys: &str| format!("{ONE}{keys}");
    check_errors(&[
        (
            one("delta_minus = 1"),
            "dof[0].delta_minus: got 1, expected at most delta_plus",
        ),
        (
            one("delta_plus = 0.8"),
            "dof[0].delta_plus: got 0.8, expected at most 2/3 width_limit",
        ),
        (
            one("delta_minus = -0.6\ndelta_plus = 0.6"),
            "dof[0].delta_plus: got 0.6, expected at most width_limit above",
        ),
        (
            "[insertion]\ndelta_minus = -5.0\ndelta_plus = 5.0".into(),
            "insertion.delta_minus: got -5, expected at most safety.offset_limit = 0.008 from 0",
        ),
    ]);
    let wide = [
        one("delta_minus = -0.9\ndelta_plus = 0.9"),
        "[insertion]\ndelta_minus = -0.05\ndelta_plus = 0.05\n".into(),
    ];
    for text in wide {
        let off = format!("{text}\n[safety]\noff = [\"width_limit\"]");
        assert!(Configuration::parse(&off).is_ok(), "{off}");
    }
}

#[test]
fn both_bands_are_on_the_tip() {
    check_errors(&[
        (
            "[instrument]\nmarker_a = 0.011\nmarker_b = 0.005".into(),
            "instrument.marker_a: got 0.011, expected a band on the tip, proximal",
        ),
        (
            "[instrument]\nmarker_b = 0.019".into(),
            "instrument.marker_b: got 0.019, expected a band within tip_length",
        ),
    ]);
}

#[test]
fn open_ranges_are_without_their_ends() {
    check_errors(&[
        (
            "vision.least_inside = 0.0".into(),
            "vision.least_inside: got 0, expected above 0, below 1",
        ),
        (
            "vision.clear.least_edges = 1".into(),
            "vision.clear.least_edges: got 1, expected above 0, below 1",
        ),
        (
            "rotation.recovery = 1.0".into(),
            "rotation.recovery: got 1, expected at least 0, below 1",
        ),
    ]);
}

#[test]
fn noise_is_less_than_a_contact_and_references_are_followed() {
    check_errors(&[
        (
            "profile = \"paper\"\ninsertion.update_distance = 2e-5".into(),
            "safety.state_noise[0]: got 0.00003, expected less than a third of insertion.contact_tolerance times insertion.update_distance = 0.000008",
        ),
        (
            "safety.state_noise = [3e-5, -1.0, 0.0015]".into(),
            "safety.state_noise[1]: got -1, expected less than a third",
        ),
        (
            "experiment.bending.period = 1.0".into(),
            "experiment.bending.period: got 1, expected at least 2.827",
        ),
    ]);
    let fast = "safety.off = [\"reference_fast\"]\nexperiment.bending.period = 1.0";
    assert!(Configuration::parse(fast).is_ok());
}

#[test]
fn sections_that_are_not_read_are_checked() {
    let dof = |keys: &str| format!("{ONE}{keys}");
    check_errors(&[
        (
            dof("[kinematics]\nknid = \"two_planes\""),
            "kinematics.knid: unknown key",
        ),
        (
            format!("kinematics = 3\n{ONE}"),
            "kinematics: got integer, expected a table",
        ),
        (dof("[camera]\nfxx = 1"), "camera.fxx: unknown key"),
        (
            dof("[camera]\nfx = 1"),
            "camera.fx: got 1, expected 14.1 to 12700",
        ),
        (dof("[twin]\nsead = 1"), "twin.sead: unknown key"),
        ("[twin]\nsead = 1".into(), "twin.sead: unknown key"),
        (
            "[twin.sensor]\nreadout = \"x\"".into(),
            "twin.sensor.readout: got \"x\", expected a number",
        ),
        (
            "twin.bends = 7".into(),
            "twin.bends: got 7, expected 0 to 6",
        ),
        (
            "recording = 1".into(),
            "recording: got integer, expected a table",
        ),
        ("drives = 1".into(), "drives: got integer, expected a table"),
    ]);
    let accepted = "safety.unusual = [\"twin.latency\"]\ntwin.latency = 60.0\ntwin.sensor.jpeg_quality = 90\n\
        twin.background = \"a.png\"\ncalibration.camera.date = \"2026-01-01\"\n";
    for text in [
        accepted.into(),
        format!("{accepted}{ONE}[camera]\nwidth = 640"),
    ] {
        let found = Configuration::parse(&text);
        assert!(found.is_ok(), "{:?}", found.err());
    }
}

#[test]
fn a_delay_is_within_history_and_age() {
    check_errors(&[
        (
            format!("{ONE}[measurement]\ndelays = [0.1, 0.4]"),
            "measurement.delays[1]: got 0.4, expected at most safety.frame_age = 0.3",
        ),
        (
            format!("{ONE}[measurement]\ndelays = [3.0]\n[safety]\noff = [\"late\"]"),
            "measurement.delays[0]: got 3, expected at most control.history = 2",
        ),
    ]);
}

#[test]
fn errors_name_the_degree_of_freedom() {
    let dof = |keys: &str| format!("{ONE}{keys}");
    let second = |keys: &str| dof(&format!("{}{keys}", ONE.replace("\"a\"", "\"b\"")));
    let nine: String = (0..9)
        .map(|index| ONE.replace("\"a\"", &format!("\"a{index}\"")))
        .collect();
    check_errors(&[
        ("dof = 1".into(), "dof: got integer, expected [[dof]]"),
        ("dof = [1]".into(), "dof[0]: got integer, expected a table"),
        (nine, "dof: got 9, expected 1 to 8 degrees of freedom"),
        (
            "[[dof]]\nname = \"a\"".into(),
            "dof[0].width_limit: expected a value: it has no default",
        ),
        ("[[dof]]\nwidth_limit = 1".into(), "dof[0].name: got \"\""),
        (
            ONE.repeat(2),
            "dof[1].name: got \"a\", expected a name used once",
        ),
        (second("widht = 3"), "dof[1].widht: unknown key"),
        (
            second("lever = \"long\""),
            "dof[1].lever: got \"long\", expected a number",
        ),
        (
            second("range = [1, \"a\"]"),
            "dof[1].range: invalid type: string \"a\", expected f64",
        ),
        (second("range = [-inf, inf]"), "dof[1].range[0]: got -inf"),
        (
            second("range = [1, -1]"),
            "dof[1].range[1]: got -1, expected above range[0]",
        ),
        (second("range = [-180, 180]"), "not mm and degrees"),
        (second("speed = -1"), "dof[1].speed: got -1"),
        (second("speed = 0"), "dof[1].speed: got 0"),
        (second("lever = 0"), "dof[1].lever: got 0"),
        (
            second("expected_width = 2"),
            "dof[1].expected_width: got 2, expected at most width_limit",
        ),
        (
            second("expected_width = -1"),
            "dof[1].expected_width: got -1",
        ),
        (second("gain_limit = 0.5"), "dof[1].gain_limit: got 0.5"),
        (
            second("unit = \"mm\""),
            "dof[1].unit: got \"mm\", expected \"m\" or \"rad\"",
        ),
        (
            second("").replace("1.0\n[[", "-1.0\n[["),
            "dof[0].width_limit: got -1, expected above 0, at most 100",
        ),
        (
            dof("unit = \"m\"").replace("1.0", "12"),
            "dof[0].width_limit: got 12, expected at most 1 m",
        ),
        (
            dof("unit = \"m\"\nspeed = 60"),
            "dof[0].speed: got 60, expected at most 10 m/s",
        ),
        (
            dof("[measurement]\ndelays = [0.0, -0.1]"),
            "measurement.delays[1]: got -0.1, expected at least 0",
        ),
        (
            dof("[measurement]\ndelays = [0, 0, 0, 0, 0.1]"),
            "measurement.delays[4]: got 0.1, expected a list of at most 4",
        ),
        (
            dof("[measurement]\ndelays = [0.0, 100.0]"),
            "measurement.delays[1]: got 100, expected at most control.history = 2",
        ),
        (
            dof("[actuators]\nmatrix = [[3.0]]"),
            "actuators: got keys, expected none: rigs whose motors are not",
        ),
        (
            "[actuators]\nmatrix = [[3.0]]".into(),
            "actuators: got keys, expected none",
        ),
        (
            dof("[kinematics]\nkind = \"two_planes\""),
            "kinematics.kind: got \"two_planes\", expected \"joints\"",
        ),
        (
            dof("[safety]\nwidth_limit = [1, 1, 1]"),
            "safety.width_limit: not used with [[dof]]",
        ),
    ]);
}

#[test]
fn numbers_have_the_ranges_of_python() {
    let dof = |keys: &str| format!("{ONE}{keys}");
    check_errors(&[
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
            "safety.width_limit[0]: got 12, expected 0.0004 to 0.36, or named in safety.unusual",
        ),
        (
            "safety.command_travel = [[-0.1, 0.3], [-12.6, 722], [-4, 4]]".into(),
            "safety.command_travel[1][1]: got 722, expected -378 to 378",
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
        (
            dof("lever = 101"),
            "dof[0].lever: got 101, expected above 0, at most 100",
        ),
        (dof("[safety]\nstall = 1e4"), "safety.stall: got 10000"),
    ]);
}

#[test]
fn what_has_no_effect_is_refused() {
    check_errors(&[
        (
            format!("{ONE}lever = 2.0"),
            "dof[0].lever: got 2, expected its default: dof[0] shares no friction",
        ),
        (
            format!("{ONE}friction = \"shaft\""),
            "dof[0].friction: got \"shaft\", expected the name of two or more DOFs",
        ),
        (
            format!("{ONE}[rotation]\ngain_limit = 4.0"),
            "rotation.gain_limit: not used with [[dof]]",
        ),
        (
            format!("{ONE}[estimation]\nmarker_deviation = 0.2"),
            "estimation.marker_deviation: not used with [[dof]]",
        ),
        (
            "[measurement]\ndelays = [0.1]".into(),
            "measurement.delays: not used without [[dof]]",
        ),
    ]);
}

#[test]
fn an_unusual_number_is_allowed_by_name() {
    let stall = "[safety]\nunusual = [\"safety.stall\"]\nstall = 1e4";
    assert!(Configuration::parse(stall).is_ok());
    let nan = stall.replace("1e4", "nan");
    assert!(error(&nan).contains("safety.stall: got NaN"));
}

#[test]
fn names_are_those_of_python() {
    let named = |name: &str| Configuration::parse(&ONE.replace("\"a\"", &format!("{name:?}")));
    let longest = "a".repeat(32);
    for name in ["a", "bend_x", "axis_1", &longest] {
        assert!(named(name).is_ok(), "{name}");
    }
    for name in [
        "a b",
        "Bend",
        "1",
        "_a",
        "ä",
        "a\n",
        "",
        &format!("{longest}a"),
    ] {
        let found = named(name).err().map(|error| error.to_string());
        assert!(
            found.is_some_and(|found| found.starts_with("dof[0].name: got ")),
            "{name}"
        );
    }
}

#[test]
fn what_comes_with_the_package_is_read() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs");
    let mut read = 0;
    for file in std::fs::read_dir(folder).unwrap() {
        let path = file.unwrap().path();
        let text = std::fs::read_to_string(&path).unwrap();
        if text.contains("two_planes") {
            assert!(error(&text).starts_with("kinematics.kind: got \"two_planes\""));
        } else if path.extension().is_some_and(|end| end == "toml") {
            let made = Configuration::parse(&text).and_then(|own| own.build());
            assert!(made.is_ok(), "{}: {:?}", path.display(), made.err());
            read += 1;
        }
    }
    assert!(read > 4);
}

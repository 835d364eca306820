//! What the integrator says: depth, roulette, hidden emitters.

use super::measure::{LAMP, PATH, STAGE, expect_quarters, load_in, scene, usual_sensor};
use reprobe::scene::film::Filter;
use reprobe::transport::path::PathParams;

const GLASS: &str = "<shape type='sphere'><float name='radius' value='.35'/><point name='center' x='-.2' y='-.4' z='1.4'/>
    <bsdf type='dielectric'/></shape>";

fn expect(integrator: &str, more: &str, mitsuba: [[f64; 3]; 4], error: f64) {
    let inside = format!("{integrator}{}{STAGE}{more}", usual_sensor());
    let loaded = scene(&inside);
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    expect_quarters(&inside, 384, Filter::Box, mitsuba, error);
}

const HIDE: &str = "<integrator type='path'><boolean name='hide_emitters' value='true'/></integrator>";

#[test]
fn a_hidden_sky_is_black_and_shines() {
    expect(
        HIDE,
        "",
        [[0.10511, 0.10595, 0.16068], [0.13128, 0.14224, 0.16775], [0.10764, 0.09658, 0.14554], [0.10774, 0.12184, 0.17491]],
        4.9e-05,
    );
}

#[test]
fn one_sees_past_hidden_lamps() {
    expect(
        HIDE,
        LAMP,
        [[0.18168, 0.15019, 0.1729], [0.15004, 0.15382, 0.17041], [0.14509, 0.11607, 0.15142], [0.11785, 0.1275, 0.17643]],
        5.9e-05,
    );
}

#[test]
fn glass_shows_hidden_lamps() {
    expect(
        HIDE,
        &format!("{LAMP}{GLASS}"),
        [[0.18201, 0.15032, 0.17285], [0.15014, 0.15388, 0.1704], [0.17189, 0.15834, 0.20933], [0.12073, 0.1303, 0.17919]],
        9.7e-05,
    );
}

#[test]
fn direct_light_can_hide_its_lamps() {
    expect(
        "<integrator type='direct'><boolean name='hide_emitters' value='true'/></integrator>",
        LAMP,
        [[0.17596, 0.14534, 0.16798], [0.14487, 0.1493, 0.16551], [0.14124, 0.1126, 0.14765], [0.1143, 0.1236, 0.17151]],
        8.0e-05,
    );
}

#[test]
fn the_direct_integrator_stops_at_the_first_surface() {
    expect(
        "<integrator type='direct'/>",
        LAMP,
        [[1.05467, 0.75293, 0.49401], [0.19105, 0.20319, 0.24249], [0.39428, 0.31403, 0.31259], [0.16897, 0.18738, 0.26262]],
        2.3e-04,
    );
}

#[test]
fn max_depth_counts_and_rr_depth_does_not_change_the_mean() {
    let three = "<integrator type='path'><integer name='max_depth' value='3'/><integer name='rr_depth' value='50'/></integrator>";
    expect(
        three,
        LAMP,
        [[1.05727, 0.7555, 0.49678], [0.19488, 0.20678, 0.24635], [0.39684, 0.31651, 0.31527], [0.17162, 0.19051, 0.26653]],
        2.2e-04,
    );
    expect(
        "<integrator type='path'><integer name='max_depth' value='1'/></integrator>",
        LAMP,
        [[0.93164, 0.64641, 0.37806], [0.04619, 0.05388, 0.07698], [0.26695, 0.21055, 0.17586], [0.05467, 0.06378, 0.09111]],
        1.9e-04,
    );
    expect(
        PATH,
        LAMP,
        [[1.05831, 0.75624, 0.4976], [0.19622, 0.20771, 0.24739], [0.39775, 0.31716, 0.31602], [0.17251, 0.19128, 0.26754]],
        2.2e-04,
    );
}

#[test]
fn depths_are_those_of_the_scene() {
    let of = |integrator: &str| {
        let loaded = scene(&format!("{integrator}{}{STAGE}", usual_sensor()));
        let params = PathParams::of(&loaded);
        (params.max_depth, params.rr_depth, loaded.warnings.len())
    };
    let path = |more: &str| of(&format!("<integrator type='path'>{more}</integrator>"));
    let default = PathParams::default();
    assert_eq!(path(""), (default.max_depth, default.rr_depth, 0));
    assert_eq!(path("<integer name='max_depth' value='-1'/>"), (u32::MAX, default.rr_depth, 0));
    assert_eq!(path("<integer name='max_depth' value='8'/><integer name='rr_depth' value='7'/>"), (7, 7, 0));
    assert_eq!(path("<integer name='max_depth' value='0'/>"), (0, default.rr_depth, 1));
    let nested = "<integrator type='aov'><string name='aovs' value='dd:depth'/><integrator type='path'><integer name='max_depth' \
                  value='4'/></integrator></integrator>";
    assert_eq!(of(nested), (3, default.rr_depth, 0));
    assert_eq!(of("<integrator type='depth'/>"), (u32::MAX, default.rr_depth, 1));
}

#[test]
fn what_an_integrator_says_in_vain_is_a_warning_with_its_line() {
    let dir = tempfile::tempdir().unwrap();
    let inside = format!("{}{STAGE}\n<integrator type='path'>\n<float name='speed' value='2'/></integrator>", usual_sensor());
    let loaded = load_in(dir.path(), &inside).unwrap();
    let line = 2 + inside[..inside.find("speed").unwrap()].matches('\n').count();
    assert_eq!(loaded.warnings.len(), 1, "{:?}", loaded.warnings);
    assert!(loaded.warnings[0].contains(&format!("scene.xml:{line}: unknown property \"speed\"")), "{:?}", loaded.warnings);
}

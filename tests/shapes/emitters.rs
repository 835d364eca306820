//! Emitters that stand by themselves, and what emitting shapes reflect.

use super::measure::{PATH, STAGE, expect_quarters, load_in, scene, usual_sensor};
use reprobe::scene::film::Filter;

const TEXTURE: &str = "type='bitmap'><string name='filename' value='tex.png'/></texture>";
const AIM: &str = "<transform name='to_world'><lookat origin='1,1,4' target='0,0.1,0' up='0,1,0'/></transform>";

/// The stage without its sky.
fn dark() -> String {
    STAGE.replace("<emitter type='constant'><rgb name='radiance' value='.3,.35,.5'/></emitter>", "")
}

fn expect(more: &str, stage: &str, mitsuba: [[f64; 3]; 4], error: f64) {
    let inside = format!("{PATH}{}{stage}{more}", usual_sensor());
    let loaded = scene(&inside);
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    expect_quarters(&inside, 384, Filter::Box, mitsuba, error);
}

#[test]
fn shapes_may_refer_to_an_area_light() {
    let lamp = "<emitter type='area' id='L'><rgb name='radiance' value='3,2,1'/></emitter>
        <shape type='rectangle'><transform name='to_world'><scale value='.4'/><rotate x='1' angle='50'/><translate y='-1.1' z='1'/>
        </transform><ref id='L'/></shape>";
    expect(lamp, &dark(), [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]], 1.0e-06);
}

#[test]
fn two_shapes_may_refer_to_one_area_light() {
    let lamp = "<emitter type='area' id='L'/><shape type='disk'><ref id='L'/></shape><shape type='cube'><ref id='L'/></shape>";
    assert_eq!(scene(lamp).emitters.len(), 2);
}

#[test]
fn an_area_light_that_no_shape_refers_to_is_a_warning_with_its_line() {
    let dir = tempfile::tempdir().unwrap();
    let warnings = load_in(dir.path(), "<shape type='cube'/>\n<emitter type='area' id='L'/>").unwrap().warnings.join("\n");
    assert!(warnings.contains("scene.xml:3") && warnings.contains("no shape"), "{warnings}");
}

#[test]
fn a_lamp_without_a_scattering_model_reflects_nothing() {
    let lamp =
        "<shape type='rectangle'><transform name='to_world'><scale value='.4'/><translate x='-.7' y='-.4' z='1'/></transform>
        <emitter type='area'><rgb name='radiance' value='.2,.2,.2'/></emitter></shape>";
    expect(
        lamp,
        STAGE,
        [[0.15654, 0.16733, 0.24747], [0.17723, 0.19597, 0.24454], [0.17294, 0.16996, 0.19273], [0.15991, 0.1834, 0.26258]],
        3.5e-05,
    );
}

#[test]
fn a_spot_throws_its_texture() {
    let spot = format!(
        "<emitter type='spot'><float name='cutoff_angle' value='30'/><float name='beam_width' value='20'/>
         <texture name='texture' {TEXTURE}<rgb name='intensity' value='20,30,40'/>{AIM}</emitter>"
    );
    expect(
        &spot,
        &dark(),
        [[0.01032, 0.02593, 0.00861], [0.01771, 0.02647, 0.01453], [0.0029, 0.01865, 0.0065], [0.00382, 0.01408, 0.0105]],
        3.0e-06,
    );
}

#[test]
fn a_projector_throws_its_image() {
    let projector = format!(
        "<emitter type='projector'><float name='fov' value='30'/><float name='scale' value='10'/>
         <texture name='irradiance' {TEXTURE}{AIM}</emitter>"
    );
    expect(
        &projector,
        &dark(),
        [[0.00493, 0.00393, 0.0037], [0.01423, 0.04731, 0.00802], [0.00875, 0.00178, 0.00248], [0.01367, 0.02114, 0.00392]],
        4.3e-06,
    );
}

/// Upright: Mitsuba's sky has its zenith at +Z.
const UPRIGHT: &str = "<transform name='to_world'><rotate x='1' angle='-90'/></transform>";

/// The errors are not Mitsuba's, which are smaller: our sky is a fit to its, good to half a percent.
const FIT: f64 = 2.5e-4;

#[test]
fn a_wide_sun_has_a_penumbra() {
    let sun = format!(
        "<emitter type='sunsky'>{UPRIGHT}<vector name='sun_direction' x='-.5' y='.6' z='.7'/>
         <float name='sun_aperture' value='12'/></emitter>"
    );
    expect(
        &sun,
        &dark(),
        [[0.15381, 0.12467, 0.11357], [0.17001, 0.1464, 0.11288], [0.13141, 0.08766, 0.07697], [0.06488, 0.05377, 0.04982]],
        FIT,
    );
}

#[test]
fn a_narrow_sun_shines_on_rough_metal() {
    let sun = format!(
        "<emitter type='sunsky'>{UPRIGHT}<vector name='sun_direction' x='.4' y='.5' z='.8'/></emitter>
         <shape type='sphere'><float name='radius' value='.3'/><point name='center' x='-.6' y='-.3' z='.9'/>
         <bsdf type='roughconductor'><float name='alpha' value='.15'/></bsdf></shape>"
    );
    expect(
        &sun,
        &dark(),
        [[0.15561, 0.12041, 0.10935], [0.20594, 0.16883, 0.11766], [0.10395, 0.07876, 0.06757], [0.11776, 0.09969, 0.08424]],
        FIT,
    );
}

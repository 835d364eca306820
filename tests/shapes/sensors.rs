//! Sensors and films.

use super::measure::{LOOK_AT, PATH, STAGE, expect_quarters, load_in, scene, sensor, usual_sensor};
use glam::{Vec2, Vec3};
use reprobe::scene::Camera;
use reprobe::scene::film::Filter;

const FOV: &str = "<float name='fov' value='40'/>";
const SHIFT: &str = "<float name='principal_point_offset_x' value='0.2'/><float name='principal_point_offset_y' value='-0.13'/>";
const CROP: &str = "<integer name='crop_offset_x' value='10'/><integer name='crop_offset_y' value='5'/>
    <integer name='crop_width' value='24'/><integer name='crop_height' value='20'/>";

fn expect(sensor: &str, mitsuba: [[f64; 3]; 4], error: f64) {
    let inside = format!("{PATH}{sensor}{STAGE}");
    let loaded = scene(&inside);
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    expect_quarters(&inside, 192, Filter::Box, mitsuba, error);
}

fn camera(sensor: &str) -> Camera {
    let loaded = scene(&format!("{PATH}{sensor}{STAGE}"));
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    loaded.sensor.unwrap()
}

#[test]
fn a_shifted_lens_shifts_the_image() {
    expect(
        &sensor("perspective", &format!("{FOV}{SHIFT}"), LOOK_AT, ""),
        [[0.16453, 0.17273, 0.2356], [0.23371, 0.26343, 0.37828], [0.14751, 0.15978, 0.20383], [0.2336, 0.26268, 0.36865]],
        4.2e-05,
    );
}

#[test]
fn a_shift_of_zero_is_no_shift() {
    let zero = SHIFT.replace("0.2", "0").replace("-0.13", "0");
    let blender = format!("{FOV}{zero}<float name='near_clip' value='0.1'/><float name='far_clip' value='100'/>");
    assert_eq!(camera(&sensor("perspective", &blender, LOOK_AT, "")), camera(&usual_sensor()));
}

#[test]
fn a_crop_window_is_what_is_rendered() {
    assert_eq!(camera(&sensor("perspective", FOV, LOOK_AT, CROP)).size, [24, 20]);
    expect(
        &sensor("perspective", FOV, LOOK_AT, CROP),
        [[0.13058, 0.12527, 0.18651], [0.17185, 0.22294, 0.23364], [0.13105, 0.12996, 0.19236], [0.17786, 0.23835, 0.24492]],
        1.0e-04,
    );
    let shifted = format!("{FOV}{SHIFT}<string name='fov_axis' value='y'/>");
    expect(
        &sensor("perspective", &shifted, LOOK_AT, CROP),
        [[0.16963, 0.18225, 0.26835], [0.22056, 0.2331, 0.33542], [0.17575, 0.22637, 0.23355], [0.20087, 0.23322, 0.3185]],
        1.1e-04,
    );
}

#[test]
fn clipping_planes_cut() {
    let planes = |far: &str| format!("{FOV}<float name='near_clip' value='3.1'/><float name='far_clip' value='{far}'/>");
    expect(
        &sensor("perspective", &planes("3.7"), LOOK_AT, ""),
        [[0.29059, 0.34043, 0.48224], [0.26595, 0.31217, 0.4405], [0.29567, 0.3458, 0.49153], [0.28059, 0.32923, 0.46493]],
        2.4e-05,
    );
    let lens = "<float name='aperture_radius' value='.1'/><float name='focus_distance' value='3'/>";
    expect(
        &sensor("thinlens", &format!("{}{lens}", planes("3.9")), LOOK_AT, ""),
        [[0.27981, 0.32786, 0.46428], [0.15635, 0.18135, 0.26223], [0.29246, 0.34206, 0.48617], [0.24925, 0.29268, 0.4127]],
        2.7e-05,
    );
}

#[test]
fn parallel_rays_are_mitsubas() {
    let narrow = format!("<scale x='1.5' y='1.1'/>{LOOK_AT}");
    expect(
        &sensor("orthographic", "", &narrow, ""),
        [[0.17015, 0.17211, 0.24687], [0.17687, 0.20096, 0.25959], [0.16197, 0.16915, 0.25812], [0.17376, 0.18405, 0.25173]],
        6.3e-05,
    );
    let planes = "<float name='near_clip' value='3.3'/><float name='far_clip' value='3.8'/>";
    let deep = format!("<scale x='1.5' y='1.5' z='1.02'/>{LOOK_AT}");
    expect(
        &sensor("orthographic", planes, &deep, CROP),
        [[0.28793, 0.33595, 0.47985], [0.13618, 0.15894, 0.22685], [0.27792, 0.32428, 0.46315], [0.10349, 0.1208, 0.17237]],
        1.1e-04,
    );
}

#[test]
fn look_at_without_up_looks_like_mitsubas() {
    expect(
        &sensor("perspective", FOV, "<lookat origin='0.3,0.5,4' target='0,0,0'/>", ""),
        [[0.1774, 0.19597, 0.24448], [0.16792, 0.19189, 0.27373], [0.15749, 0.16724, 0.24947], [0.1746, 0.17545, 0.25826]],
        4.7e-05,
    );
}

#[test]
fn rotations_about_long_axes_are_mitsubas() {
    let inside = format!(
        "{PATH}{}{STAGE}<shape type='rectangle'><transform name='to_world'><scale value='.5'/><rotate x='1' y='1' angle='40'/>
         <translate z='1'/></transform><bsdf type='twosided'><bsdf type='diffuse'/></bsdf></shape>",
        usual_sensor()
    );
    let (mitsuba, error) = (
        [[0.15551, 0.17279, 0.26551], [0.17157, 0.18574, 0.24136], [0.1801, 0.18944, 0.27006], [0.1592, 0.1858, 0.26893]],
        4.3e-05,
    );
    expect_quarters(&inside, 192, Filter::Box, mitsuba, error);
}

/// Six by four pixels, each filtered over much of the image, edges and all.
#[test]
fn the_films_filter_blurs_like_mitsubas() {
    let gaussian = "<rfilter type='gaussian'><float name='stddev' value='1.2'/></rfilter>";
    let tent = "<rfilter type='tent'><float name='radius' value='2.5'/></rfilter>";
    for (filter, (mitsuba, error)) in [
        (
            gaussian,
            (
                [
                    [0.16526, 0.17366, 0.24254],
                    [0.16549, 0.1909, 0.24585],
                    [0.16481, 0.1719, 0.24721],
                    [0.16378, 0.18265, 0.24652],
                ],
                4.6e-04,
            ),
        ),
        (
            tent,
            (
                [
                    [0.16561, 0.17322, 0.24277],
                    [0.16613, 0.19259, 0.24657],
                    [0.16537, 0.1719, 0.24846],
                    [0.16427, 0.1834, 0.24755],
                ],
                4.8e-04,
            ),
        ),
        (
            "<rfilter type='lanczos'/>",
            (
                [
                    [0.16538, 0.16629, 0.23825],
                    [0.1695, 0.20223, 0.2529],
                    [0.16415, 0.16794, 0.25416],
                    [0.16429, 0.17931, 0.24816],
                ],
                6.9e-04,
            ),
        ),
        (
            "",
            (
                [[0.16597, 0.1699, 0.24232], [0.16902, 0.19853, 0.25054], [0.16604, 0.17034, 0.2535], [0.16453, 0.1817, 0.25065]],
                6.3e-04,
            ),
        ),
    ] {
        let film = usual_sensor().replace("<rfilter type='box'/>", filter).replace("'48'", "'6'").replace("'36'", "'4'");
        let inside = format!("{PATH}{film}{STAGE}");
        let loaded = scene(&inside);
        assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
        assert_ne!(loaded.film_filter.filter, Filter::Box);
        expect_quarters(&inside, 24_000, loaded.film_filter.filter, mitsuba, error);
    }
}

#[test]
fn every_projection_is_inverted() {
    let at = [Vec2::new(0.5, 0.5), Vec2::new(20.0, 3.0), Vec2::new(11.25, 17.5)];
    for camera in [
        camera(&sensor("perspective", &format!("{FOV}{SHIFT}"), LOOK_AT, CROP)),
        camera(&sensor("orthographic", "", &format!("<scale x='1.5' y='1.1'/>{LOOK_AT}"), CROP)),
    ] {
        for pixel in at {
            let back = camera.project(camera.ray(pixel, Vec2::splat(0.5)).at(2.5)).unwrap();
            assert!((back - pixel).length() < 1e-3, "{pixel} -> {back}");
        }
        assert_eq!(camera.project(camera.position() - camera.to_world.transform_vector3(Vec3::Z)), None);
    }
}

#[test]
fn impossible_films_and_planes_are_errors_with_their_line() {
    let dir = tempfile::tempdir().unwrap();
    let wide = CROP.replace("'24'", "'240'");
    for (text, expected) in [
        (sensor("perspective", FOV, LOOK_AT, &wide), "crop_width = 240"),
        (sensor("perspective", FOV, LOOK_AT, "<integer name='crop_offset_x' value='3'/>"), "crop_width = 48"),
        (
            sensor(
                "perspective",
                &format!("{FOV}<float name='near_clip' value='3'/><float name='far_clip' value='2'/>"),
                LOOK_AT,
                "",
            ),
            "near < far",
        ),
        (sensor("fisheye", FOV, LOOK_AT, ""), "orthographic"),
    ] {
        let message = load_in(dir.path(), &format!("{STAGE}{text}")).unwrap_err().to_string();
        assert!(message.contains("scene.xml:") && message.contains(expected), "{message}");
    }
}

// Light of receivers in free space, in `volume_light`. Twin: src/method/radiance_probes/volume.rs: irradiance.

// #include "radiance_probes/taps.wgsl"

// E_T by way of these receivers.
fn irradiance_of(taps: Taps) -> vec3<f32> {
    var sum = vec3(0.0);
    for (var k = 0u; k < 8u; k++) {
        if taps.weights[k] > 0.0 {
            for (var j = 0u; j < VOLUME_NUMBERS; j++) {
                sum += volume_light[VOLUME_NUMBERS * taps.points[k] + j].xyz * (taps.factors[j] * taps.weights[k]);
            }
        }
    }
    return max(sum, vec3(0.0));
}

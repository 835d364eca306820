//! Where the sun stands at a time and place: Blanco-Muriel et al., "Computing the Solar Vector", Solar Energy 70(5), 2001. Good to half
//! a minute of arc from 1999 to 2015.

use glam::DVec3;

/// Mean radius of the earth over its mean distance to the sun.
const PARALLAX: f64 = 6371.01 / 149_597_890.0;

/// A time and a place. The defaults are Mitsuba's: an afternoon in Tokyo.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// Degrees north.
    pub latitude: f64,
    /// Degrees east.
    pub longitude: f64,
    /// Hours by which clocks are before universal time.
    pub timezone: f64,
    /// Gregorian.
    pub year: i64,
    /// 1 to 12.
    pub month: i64,
    /// From 1.
    pub day: i64,
    /// Since midnight, and so on; fractions count.
    pub hour: f64,
    /// Of the hour.
    pub minute: f64,
    /// Of the minute.
    pub second: f64,
}

impl Default for Moment {
    fn default() -> Self {
        Self {
            latitude: 35.6894,
            longitude: 139.6917,
            timezone: 9.0,
            year: 2010,
            month: 7,
            day: 10,
            hour: 15.0,
            minute: 0.0,
            second: 0.0,
        }
    }
}

impl Moment {
    /// Hours of universal time since midnight of the local day.
    fn universal_hours(&self) -> f64 {
        self.hour - self.timezone + (self.minute + self.second / 60.0) / 60.0
    }

    /// Days since noon of 1 January 2000, universal time.
    fn days(&self) -> f64 {
        // January and February count as the last months of the year before. Divisions of whole numbers go towards 0.
        let (year, month) = if self.month < 3 { (self.year - 1, self.month + 12) } else { (self.year, self.month) };
        let julian = 1461 * (year + 4800) / 4 + 367 * (month - 2) / 12 - 3 * ((year + 4900) / 100) / 4 + self.day - 32075;
        julian as f64 - 0.5 + self.universal_hours() / 24.0 - 2_451_545.0
    }

    /// Unit direction to the sun: Z up, X south, Y west. (So Mitsuba has it, though its manual says north; seen from above it is
    /// a mirrored map.)
    pub fn sun(&self) -> DVec3 {
        let days = self.days();
        let (longitude, obliquity) = ecliptic(days);
        let (sin, cos) = longitude.sin_cos();
        let right_ascension = (obliquity.cos() * sin).atan2(cos);
        let declination = (obliquity.sin() * sin).asin();

        let sidereal_hours = 6.697_424_324_2 + 0.065_709_828_3 * days + self.universal_hours();
        let hour_angle = (15.0 * sidereal_hours + self.longitude).to_radians() - right_ascension;
        let (sin_latitude, cos_latitude) = self.latitude.to_radians().sin_cos();
        let cos_zenith = cos_latitude * hour_angle.cos() * declination.cos() + declination.sin() * sin_latitude;
        let zenith = cos_zenith.clamp(-1.0, 1.0).acos();
        let east = -hour_angle.sin();
        let north = declination.tan() * cos_latitude - sin_latitude * hour_angle.cos();
        let azimuth = east.atan2(north);
        let zenith = zenith + PARALLAX * zenith.sin();
        -DVec3::new(azimuth.cos(), azimuth.sin(), 0.0) * zenith.sin() + DVec3::Z * zenith.cos()
    }
}

/// The sun's ecliptic longitude and the obliquity of the ecliptic, radians.
fn ecliptic(days: f64) -> (f64, f64) {
    let omega = 2.1429 - 0.001_039_459_4 * days;
    let mean_longitude = 4.895_063_0 + 0.017_202_791_698 * days;
    let anomaly = 6.240_060_0 + 0.017_201_969_9 * days;
    let longitude = mean_longitude + 0.033_416_07 * anomaly.sin() + 0.000_348_94 * (2.0 * anomaly).sin()
        - 0.000_113_4
        - 0.000_020_3 * omega.sin();
    (longitude, 0.409_092_8 - 6.2140e-9 * days + 0.000_039_6 * omega.cos())
}

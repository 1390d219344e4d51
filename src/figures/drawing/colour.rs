//! Colours distinguishable with colour blindness (Okabe & Ito 2008), and colour maps of monotonic lightness, which
//! remain readable in grey print.

/// A colour: red, green, blue, and opacity in 255ths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Colour(pub [u8; 4]);

impl Colour {
    /// The colour written as `0xrrggbb`.
    pub const fn hex(rgb: u32) -> Self {
        Colour([(rgb >> 16) as u8, (rgb >> 8) as u8, rgb as u8, 255])
    }

    /// The same with an opacity from 0 to 1.
    pub fn opacity(self, opacity: f64) -> Self {
        let [r, g, b, _] = self.0;
        Colour([r, g, b, (255.0 * opacity).round() as u8])
    }

    fn between(self, other: Colour, t: f64) -> Colour {
        let mix = |k: usize| (f64::from(self.0[k]) * (1.0 - t) + f64::from(other.0[k]) * t).round() as u8;
        Colour([mix(0), mix(1), mix(2), 255])
    }
}

/// Black.
pub const BLACK: Colour = Colour::hex(0x000000);
/// White.
pub const WHITE: Colour = Colour::hex(0xffffff);
/// Grey, for the background.
pub const GREY: Colour = Colour::hex(0x8a8a8a);
/// Blue.
pub const BLUE: Colour = Colour::hex(0x0072b2);
/// Vermilion, for injected values.
pub const VERMILION: Colour = Colour::hex(0xd55e00);
/// Green.
pub const GREEN: Colour = Colour::hex(0x009e73);
/// Purple.
pub const PURPLE: Colour = Colour::hex(0xcc79a7);
/// Orange.
pub const ORANGE: Colour = Colour::hex(0xe69f00);
/// Light blue.
pub const SKY: Colour = Colour::hex(0x56b4e9);

/// Colours of series, in order.
pub const SERIES: [Colour; 7] = [BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY, BLACK];

/// A scale of colours for numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColourMap {
    /// Dark blue to yellow, by Nunez et al. 2018: the same with colour blindness.
    Cividis,
    /// Pale yellow to black: from photosphere to spot.
    Spots,
    /// Black over pale yellow in the middle to dark blue: darker and brighter than the photosphere.
    Brightness,
    /// Blue over white in the middle to red: below and above zero (the ends of `RdBu`, Brewer & Harrower).
    Diverging,
}

impl ColourMap {
    fn anchors(self) -> &'static [Colour] {
        const CIVIDIS: [Colour; 10] = [
            Colour::hex(0x00224e),
            Colour::hex(0x123570),
            Colour::hex(0x3b496c),
            Colour::hex(0x575d6d),
            Colour::hex(0x707173),
            Colour::hex(0x8a8678),
            Colour::hex(0xa59c74),
            Colour::hex(0xc3b369),
            Colour::hex(0xe1cc55),
            Colour::hex(0xfee838),
        ];
        const SPOTS: [Colour; 6] = [
            Colour::hex(0xfff6dc),
            Colour::hex(0xf9d58a),
            Colour::hex(0xe2a04a),
            Colour::hex(0xb0642f),
            Colour::hex(0x663322),
            Colour::hex(0x1e1014),
        ];
        const BRIGHTNESS: [Colour; 11] = [
            SPOTS[5],
            SPOTS[4],
            SPOTS[3],
            SPOTS[2],
            SPOTS[1],
            SPOTS[0],
            Colour::hex(0xb9dcea),
            Colour::hex(0x6fb1d6),
            Colour::hex(0x307eb8),
            Colour::hex(0x124c86),
            Colour::hex(0x08234f),
        ];
        const DIVERGING: [Colour; 11] = [
            Colour::hex(0x053061),
            Colour::hex(0x2166ac),
            Colour::hex(0x4393c3),
            Colour::hex(0x92c5de),
            Colour::hex(0xd1e5f0),
            WHITE,
            Colour::hex(0xfddbc7),
            Colour::hex(0xf4a582),
            Colour::hex(0xd6604d),
            Colour::hex(0xb2182b),
            Colour::hex(0x67001f),
        ];
        match self {
            ColourMap::Diverging => &DIVERGING,
            ColourMap::Brightness => &BRIGHTNESS,
            ColourMap::Cividis => &CIVIDIS,
            ColourMap::Spots => &SPOTS,
        }
    }

    /// The colour of `t` from 0 to 1, in 100 steps; beyond, that of the end.
    pub fn at(self, t: f64) -> Colour {
        let anchors = self.anchors();
        let t = (t.clamp(0.0, 1.0) * 100.0).round() / 100.0;
        let place = t * (anchors.len() - 1) as f64;
        let below = (place as usize).min(anchors.len() - 2);
        anchors[below].between(anchors[below + 1], place - below as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative luminance by ITU-R BT.709, without gamma: enough to rank.
    fn luminance(Colour([r, g, b, _]): Colour) -> f64 {
        0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)
    }

    #[test]
    fn grey_print_keeps_the_order() {
        for (map, sign) in [(ColourMap::Cividis, 1.0), (ColourMap::Spots, -1.0)] {
            let greys: Vec<f64> = (0..=20).map(|k| sign * luminance(map.at(f64::from(k) / 20.0))).collect();
            assert!(greys.windows(2).all(|w| w[1] > w[0] + 2.0), "{map:?}: {greys:?}");
        }
        // either side of the photosphere, or of zero, by itself
        for map in [ColourMap::Brightness, ColourMap::Diverging] {
            let greys: Vec<f64> = (0..=20).map(|k| luminance(map.at(f64::from(k) / 20.0))).collect();
            assert!(greys[..=10].windows(2).all(|w| w[1] > w[0] + 2.0), "{map:?}: {greys:?}");
            assert!(greys[10..].windows(2).all(|w| w[1] < w[0] - 2.0), "{map:?}: {greys:?}");
        }
        assert_eq!(ColourMap::Diverging.at(0.5), WHITE);
    }
}

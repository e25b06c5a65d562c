//! Colours for a quantity.

/// From low to high: even steps of lightness from dark blue over green to yellow, that eyes that see
/// no red or no green can order, too.
const STOPS: [[f32; 3]; 6] = [
    [56.0, 76.0, 158.0],
    [43.0, 120.0, 168.0],
    [38.0, 160.0, 146.0],
    [112.0, 190.0, 94.0],
    [206.0, 206.0, 62.0],
    [250.0, 226.0, 96.0],
];

/// The colour of a share from 0 to 1; beyond, and for what is not a number, that of the end.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "between 0 and the number of stops"
)]
pub(super) fn ramp(share: f32) -> [f32; 3] {
    let share = if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) };
    let place = share * (STOPS.len() - 1) as f32;
    let stop = (place as usize).min(STOPS.len() - 2);
    let between = place - stop as f32;
    [0, 1, 2].map(|c| STOPS[stop][c] + between * (STOPS[stop + 1][c] - STOPS[stop][c]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lightness_rises_with_the_share() {
        let lightness = |share: f32| {
            let [r, g, b] = ramp(share);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        assert!((0..100).all(|n| lightness(n as f32 / 100.0) < lightness((n + 1) as f32 / 100.0)));
        assert_eq!((ramp(-1.0), ramp(9.0), ramp(f32::NAN)), (STOPS[0], STOPS[5], STOPS[0]));
    }
}

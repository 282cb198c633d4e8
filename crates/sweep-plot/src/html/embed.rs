//! Encodings of numbers in a page: compact, and exact to the digits that a reader can see.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

/// Encodes values as little-endian 32-bit floats (7 digits) in base64.
pub fn encode_floats(values: impl Iterator<Item = f64>) -> String {
    STANDARD.encode(values.flat_map(|value| (value as f32).to_le_bytes()).collect::<Vec<u8>>())
}

/// Encodes values as little-endian 64-bit floats in base64.
pub fn encode_doubles(values: &[f64]) -> String {
    STANDARD.encode(values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>())
}

/// Encodes bytes in base64.
pub fn encode_bytes(values: impl Iterator<Item = u8>) -> String {
    STANDARD.encode(values.collect::<Vec<u8>>())
}

/// Encodes flags as bits, the least significant bit of a byte first, in base64.
pub fn encode_bits(values: &[bool]) -> String {
    let to_byte = |values: &[bool]| {
        values.iter().rev().fold(0, |byte: u8, value| byte << 1 | u8::from(*value))
    };
    STANDARD.encode(values.chunks(8).map(to_byte).collect::<Vec<u8>>())
}

/// Encodes values as little-endian 16-bit integers in base64, and returns the value of one unit:
/// 1/32767 of the peak. A value that is not finite becomes the least integer.
pub fn quantise(values: &[f64]) -> (String, f64) {
    let finite_values = values.iter().filter(|value| value.is_finite());
    let peak = finite_values.fold(0.0_f64, |peak, value| peak.max(value.abs()));
    let quantum =
        round_to_six_digits(if peak > 0.0 { peak * 1.001 / f64::from(i16::MAX) } else { 1.0 });
    let to_integer =
        |value: &f64| if value.is_finite() { (value / quantum).round() as i16 } else { i16::MIN };
    let integer_bytes =
        values.iter().flat_map(|value| to_integer(value).to_le_bytes()).collect::<Vec<u8>>();
    (STANDARD.encode(integer_bytes), quantum)
}

/// Rounds a number to six digits, so that it is written short.
pub fn round_to_six_digits(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floats_are_little_endian() {
        assert_eq!(
            STANDARD.decode(encode_floats([1.0, f64::NAN].into_iter())).unwrap()[..4],
            [0, 0, 0x80, 0x3f]
        );
    }

    #[test]
    fn the_least_significant_bit_comes_first() {
        let values: Vec<bool> = (0..10).map(|k| k == 1 || k == 9).collect();
        assert_eq!(STANDARD.decode(encode_bits(&values)).unwrap(), [0b10, 0b10]);
    }

    #[test]
    fn a_quantised_curve_is_decoded_within_half_a_unit() {
        let curve = [0.0, 0.07, -0.035, 1.0e-5, f64::NAN];
        let (data, unit) = quantise(&curve);
        let decoded: Vec<i16> = STANDARD
            .decode(data)
            .unwrap()
            .chunks(2)
            .map(|pair| i16::from_le_bytes([pair[0], pair[1]]))
            .collect();
        assert_eq!(decoded[4], i16::MIN);
        for (value, decoded_integer) in curve.iter().zip(decoded).take(4) {
            assert!((f64::from(decoded_integer) * unit - value).abs() <= 0.07 / 32_000.0);
        }
    }

    #[test]
    fn numbers_are_rounded_to_six_digits() {
        assert_eq!(round_to_six_digits(0.1 + 0.2).to_string(), "0.3");
        assert!(round_to_six_digits(f64::NAN).is_nan());
    }
}

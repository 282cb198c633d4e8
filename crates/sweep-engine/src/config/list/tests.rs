//! Every compression, every bound, and files that are damaged.

use std::sync::Arc;

use ::parquet::basic::{Compression, GzipLevel, ZstdLevel};
use ::parquet::file::properties::{WriterProperties, WriterVersion};
use arrow_array::types::Int32Type;
use arrow_array::{ArrayRef, DictionaryArray, Float64Array, RecordBatch, UInt64Array};
use sweep_files::Writer;

use super::*;

const NAME: &str = "unbalance_mass_kg";

fn readable() -> [Compression; 5] {
    [
        Compression::UNCOMPRESSED,
        Compression::SNAPPY,
        Compression::ZSTD(ZstdLevel::default()),
        Compression::GZIP(GzipLevel::default()),
        Compression::LZ4_RAW,
    ]
}

/// A file with these columns, batch after batch.
fn file(columns: &[(&str, ArrayRef)], batches: usize, properties: WriterProperties) -> Vec<u8> {
    let batch = RecordBatch::try_from_iter(columns.iter().cloned()).unwrap();
    let mut bytes = Vec::new();
    let mut writer = Writer::new(&mut bytes, &batch.schema(), properties).unwrap();
    for _ in 0..batches {
        writer.write(&batch).unwrap();
    }
    writer.end().unwrap().close().unwrap();
    bytes
}

fn compressed(codec: Compression, version: WriterVersion) -> WriterProperties {
    WriterProperties::builder().set_compression(codec).set_writer_version(version).build()
}

/// A mass and a whole number of kilograms.
fn small(codec: Compression, version: WriterVersion) -> Vec<u8> {
    let masses = (0..300).map(|k| 0.1 + 0.001 * f64::from(k % 50)).collect::<Vec<_>>();
    let frames = (0..300).map(|k| 20 + k % 7).collect::<Vec<_>>();
    let masses: ArrayRef = Arc::new(Float64Array::from(masses));
    let frames: ArrayRef = Arc::new(UInt64Array::from(frames));
    file(&[(NAME, masses), ("frame_mass_kg", frames)], 1, compressed(codec, version))
}

fn refusal(bytes: Vec<u8>) -> String {
    parquet::columns(bytes, false).expect_err("not a list").to_string()
}

#[test]
fn every_usual_compression_reads_alike() {
    let plain = small(Compression::UNCOMPRESSED, WriterVersion::PARQUET_1_0);
    let plain = parquet::columns(plain, false).unwrap();
    assert_eq!((plain[0].1[49], plain[1].1[6]), (0.1 + 0.001 * 49.0, 26.0));
    for codec in readable() {
        for version in [WriterVersion::PARQUET_1_0, WriterVersion::PARQUET_2_0] {
            let read = parquet::columns(small(codec, version), false);
            assert_eq!(read.unwrap(), plain, "{codec}, {version:?}");
        }
    }
}

#[test]
fn a_compression_that_is_not_read_is_named_with_those_that_are() {
    let snappy = small(Compression::SNAPPY, WriterVersion::PARQUET_1_0);
    // A column's codec follows its name: an i32, one field on.
    let place = [NAME.as_bytes(), &[0x15, 0x02]].concat();
    let found = snappy.windows(place.len()).position(|window| window == place);
    let place = found.unwrap() + place.len() - 1;
    for (code, name) in [(3, "lzo"), (4, "brotli"), (5, "lz4")] {
        let mut other = snappy.clone();
        other[place] = 2 * code;
        let told = refusal(other);
        let expected = format!("`{NAME}` is compressed by {name}, which this program does not");
        assert!(told.contains(&expected) && told.contains("snappy, zstd, gzip"), "{told}");
    }
}

#[test]
fn what_is_no_number_is_told_by_column() {
    let texts: ArrayRef = Arc::new(["a"].into_iter().collect::<DictionaryArray<Int32Type>>());
    let none: ArrayRef = Arc::new(Float64Array::from(vec![Some(1.0), None]));
    let of = |column: ArrayRef| refusal(file(&[("x", column)], 1, WriterProperties::default()));
    assert!(of(texts).contains("`x` holds no numbers but text"));
    assert!(of(none).contains("`x` has no value in row 2"));
}

#[test]
fn a_small_file_of_too_many_rows_is_refused_unread() {
    let column: ArrayRef = Arc::new(Float64Array::from(vec![1.0; 1_000_000]));
    let properties = compressed(Compression::SNAPPY, WriterVersion::PARQUET_1_0);
    let bytes = file(&[("x", column)], 1 + (MOST_NUMBERS / 1_000_000) as usize, properties);
    assert!(bytes.len() < 1_000_000, "{}", bytes.len());
    assert!(refusal(bytes).contains("more than 20000000 numbers"));
}

#[test]
fn damage_is_an_error_or_another_list_and_nothing_else() {
    for codec in readable() {
        let whole = small(codec, WriterVersion::PARQUET_2_0);
        for length in (0..whole.len()).step_by(7) {
            assert!(
                parquet::columns(whole[..length].to_vec(), false).is_err(),
                "{codec}: {length} bytes"
            );
        }
        for at in 0..whole.len() {
            for bit in [0, 3, 7] {
                let mut flipped = whole.clone();
                flipped[at] ^= 1 << bit;
                if let Ok(columns) = parquet::columns(flipped, false) {
                    assert!(columns.iter().all(|(_, values)| values.len() as u64 <= MOST_NUMBERS));
                }
            }
        }
    }
}

fn csv_of(text: &str) -> Result<csv::Read, Unreadable> {
    let report = Report::default();
    let source = report.add("list.csv", String::new());
    csv::read(text, source, false, &report)
}

#[test]
fn a_text_of_too_many_numbers_or_columns_is_refused() {
    let rows = "1,2\n".repeat((MOST_NUMBERS / 2) as usize);
    let (columns, starts, _) = csv_of(&format!("a,b\n{rows}")).unwrap();
    assert_eq!((columns[1].values.len(), starts.len()), (10_000_000, 10_000_000));
    let refused = |text: &str| csv_of(text).map(|_| ()).unwrap_err().to_string();
    assert!(refused(&format!("a,b\n{rows}1,2\n")).contains("more than 20000000 numbers"));
    assert!(refused(&",".repeat(100_000_000)).contains("it has 100000001 columns"));
}

#[test]
fn a_row_of_too_many_numbers_is_one_mistake() {
    let report = Report::default();
    let source = report.add("list.csv", String::new());
    let text = format!("a,b\n{}\n1,2\n", ",".repeat(100_000_000));
    assert!(csv::read(&text, source, false, &report).is_ok());
    assert_eq!(report.into_diagnostics().count(), 1);
}

#[test]
fn a_value_is_found_where_it_stands() {
    let text = "\u{feff}# by hand\r\n a , \"b\"\r\n\r\n 1,2 \r\n3 , \"4\"\r\n";
    let (columns, starts, by) = csv_of(text).unwrap();
    assert_eq!([&columns[0].values, &columns[1].values], [&[1.0, 3.0], &[2.0, 4.0]]);
    let found = |row: usize, column| &text[csv::cell_span(text, starts[row] as usize, by, column)];
    assert_eq!([found(0, 0), found(0, 1), found(1, 0), found(1, 1)], ["1", "2", "3", "\"4\""]);
    assert_eq!(
        [&text[columns[0].name.at.span.clone()], &text[columns[1].name.at.span.clone()]],
        ["a", "\"b\""]
    );
}

#[test]
fn a_cell_between_quotation_marks_may_hold_what_separates_cells() {
    let text = "id,b\n\"a,b\",2\n\"5\"\" pipe, short\",3\n5\" pipe,4\n";
    let (columns, ..) = csv_of(text).unwrap();
    assert_eq!(columns[1].values, [2.0, 3.0, 4.0]);
}

#[test]
fn a_spreadsheet_may_have_semicolons_or_tabs_and_decimal_commas() {
    for text in ["a;b\n1,5;2\n3;-4,25e2\n", "a\tb\n1.5\t2\n3\t-425\n"] {
        let (columns, starts, by) = csv_of(text).unwrap();
        assert_eq!([&columns[0].values, &columns[1].values], [&[1.5, 3.0], &[2.0, -425.0]]);
        assert_eq!(text[csv::cell_span(text, starts[0] as usize, by, 1)], *"2");
    }
    let report = Report::default();
    let source = report.add("list.csv", String::new());
    assert!(csv::read("a;b\n1;2;3\n", source, false, &report).is_ok());
    let said = report.into_diagnostics().to_string();
    assert!(said.contains("expected 2 numbers, separated by semicolons"), "{said}");
}

#[test]
fn a_file_has_one_decimal_mark_and_a_thousand_is_no_decimal() {
    let german = "unbalance_mass_kg;damping_n_s_per_m\n0,9;950,0\n0,9;1.050\n";
    let american = "unbalance_mass_kg\tdamping_n_s_per_m\n0.9\t950\n0.9\t1,050\n";
    let quoted = "unbalance_mass_kg,damping_n_s_per_m\n0.9,950\n0.9,\"1,050\"\n";
    for text in [german, american, quoted] {
        let (columns, ..) = csv_of(text).unwrap();
        assert_eq!([&columns[0].values, &columns[1].values], [&[0.9, 0.9], &[950.0, 1050.0]]);
    }
    let commas = "a,b\n1.050,950\n\"1.100\",970\n";
    assert_eq!(csv_of(commas).unwrap().0[0].values, [1.05, 1.1]);
    let said = |text: &str| {
        let report = Report::default();
        let source = report.add("list.csv", String::new());
        let read = csv::read(text, source, true, &report);
        report.fill(source, text.to_owned());
        assert!(read.unwrap().0.iter().all(|column| column.values.is_empty()));
        report.into_diagnostics().to_string()
    };
    let mixed = said("a;b\n0,9;950\n0.9;1050\n");
    for part in ["decimal points, as in `0.9`", "commas, as in `0,9`", ":2:1", ":3:1", "the same"] {
        assert!(mixed.contains(part), "{part}: {mixed}");
    }
    let unclear = said("a;b\n2;950\n3;1.050\n");
    for part in ["`1.050` may be 1050 or 1.050", ":3:3", "write 1050, or 1.0500"] {
        assert!(unclear.contains(part), "{part}: {unclear}");
    }
    assert!(said("a\n950\n1.050\n").contains("may be 1050"));
}

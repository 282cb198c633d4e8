//! Tests of lists: compressions, bounds, damaged files, and files of loggers.

use std::sync::Arc;

use ::parquet::basic::{Compression, GzipLevel, ZstdLevel};
use ::parquet::file::properties::{WriterProperties, WriterVersion};
use arrow_array::types::Int32Type;
use arrow_array::{ArrayRef, DictionaryArray, Float64Array, RecordBatch, UInt64Array};
use sweep_files::Writer;

use super::*;

const NAME: &str = "unbalance_mass_kg";

/// Names that are all known and have no unit.
const ANY_NAMES: ColumnNames<'_> =
    ColumnNames { known: &|name: &str| Some((name.to_owned(), String::new())), renamed: &[] };

/// Returns the known columns of a Parquet file.
fn read_parquet(bytes: Vec<u8>) -> Result<Vec<(String, Vec<f64>)>, ListError> {
    let columns = parquet::read_columns(bytes, false, &ANY_NAMES)?;
    Ok(columns.into_iter().map(|column| (column.name, column.values.unwrap_or_default())).collect())
}

fn supported_codecs() -> [Compression; 5] {
    [
        Compression::UNCOMPRESSED,
        Compression::SNAPPY,
        Compression::ZSTD(ZstdLevel::default()),
        Compression::GZIP(GzipLevel::default()),
        Compression::LZ4_RAW,
    ]
}

/// Returns a file with these columns, repeated in batches.
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

/// Returns a file with a column of masses and a column of whole numbers.
fn small_file(codec: Compression, version: WriterVersion) -> Vec<u8> {
    let masses = (0..300).map(|k| 0.1 + 0.001 * f64::from(k % 50)).collect::<Vec<_>>();
    let frames = (0..300).map(|k| 20 + k % 7).collect::<Vec<_>>();
    let masses: ArrayRef = Arc::new(Float64Array::from(masses));
    let frames: ArrayRef = Arc::new(UInt64Array::from(frames));
    file(&[(NAME, masses), ("frame_mass_kg", frames)], 1, compressed(codec, version))
}

fn refusal(bytes: Vec<u8>) -> String {
    read_parquet(bytes).expect_err("not a list")
}

#[test]
fn supported_compressions_give_the_same_numbers() {
    let uncompressed = small_file(Compression::UNCOMPRESSED, WriterVersion::PARQUET_1_0);
    let uncompressed = read_parquet(uncompressed).unwrap();
    assert_eq!((uncompressed[0].1[49], uncompressed[1].1[6]), (0.1 + 0.001 * 49.0, 26.0));
    for codec in supported_codecs() {
        for version in [WriterVersion::PARQUET_1_0, WriterVersion::PARQUET_2_0] {
            let columns = read_parquet(small_file(codec, version));
            assert_eq!(columns.unwrap(), uncompressed, "{codec}, {version:?}");
        }
    }
}

#[test]
fn an_unsupported_compression_is_named_with_the_supported_ones() {
    let snappy = small_file(Compression::SNAPPY, WriterVersion::PARQUET_1_0);
    // The codec of a column follows its name in the metadata, as an i32.
    let codec_pattern = [NAME.as_bytes(), &[0x15, 0x02]].concat();
    let pattern_start =
        snappy.windows(codec_pattern.len()).position(|window| window == codec_pattern);
    let codec_pattern = pattern_start.unwrap() + codec_pattern.len() - 1;
    for (code, name) in [(3, "lzo"), (4, "brotli"), (5, "lz4")] {
        let mut changed = snappy.clone();
        changed[codec_pattern] = 2 * code;
        let message = refusal(changed);
        let expected = format!("`{NAME}` is compressed by {name}, which this program does not");
        assert!(message.contains(&expected) && message.contains("snappy, zstd, gzip"), "{message}");
    }
}

#[test]
fn columns_without_numbers_are_named() {
    let texts: ArrayRef = Arc::new(["a"].into_iter().collect::<DictionaryArray<Int32Type>>());
    let none: ArrayRef = Arc::new(Float64Array::from(vec![Some(1.0), None]));
    let message =
        |column: ArrayRef| refusal(file(&[("x", column)], 1, WriterProperties::default()));
    assert!(message(texts).contains("`x` holds no numbers but text"));
    assert!(message(none).contains("`x` has no value in row 2"));
}

#[test]
fn a_small_file_with_too_many_rows_is_rejected_unread() {
    let column: ArrayRef = Arc::new(Float64Array::from(vec![1.0; 1_000_000]));
    let properties = compressed(Compression::SNAPPY, WriterVersion::PARQUET_1_0);
    let bytes = file(&[("x", column)], 1 + (MAX_NUMBERS / 1_000_000) as usize, properties);
    assert!(bytes.len() < 1_000_000, "{}", bytes.len());
    assert!(refusal(bytes).contains("more than 20000000 numbers"));
}

#[test]
fn a_damaged_file_gives_an_error_or_a_list() {
    for codec in supported_codecs() {
        let undamaged = small_file(codec, WriterVersion::PARQUET_2_0);
        for length in (0..undamaged.len()).step_by(7) {
            assert!(read_parquet(undamaged[..length].to_vec()).is_err(), "{codec}: {length} bytes");
        }
        for byte_index in 0..undamaged.len() {
            for bit in [0, 3, 7] {
                let mut flipped = undamaged.clone();
                flipped[byte_index] ^= 1 << bit;
                if let Ok(columns) = read_parquet(flipped) {
                    assert!(columns.iter().all(|(_, values)| values.len() as u64 <= MAX_NUMBERS));
                }
            }
        }
    }
}

/// Returns the position of a cell in the line that begins at a byte of a text.
fn cell_span(text: &str, start: usize, by: char, column: usize) -> std::ops::Range<usize> {
    TextLine::at(text, start).cells(by).nth(column).expect("it is there").1
}

fn read_csv(text: &str) -> Result<csv::TextTable, ListError> {
    let report = Report::default();
    let source = report.add("list.csv", String::new());
    csv::read(text, source, false, &ANY_NAMES, &report)
}

#[test]
fn a_text_with_too_many_numbers_or_columns_is_rejected() {
    let rows = "1,2\n".repeat((MAX_NUMBERS / 2) as usize);
    let csv::TextTable { columns, row_starts, .. } = read_csv(&format!("a,b\n{rows}")).unwrap();
    assert_eq!((columns[1].values.len(), row_starts.len()), (10_000_000, 10_000_000));
    let refusal_text = |text: &str| read_csv(text).map(|_| ()).unwrap_err().to_string();
    assert!(refusal_text(&format!("a,b\n{rows}1,2\n")).contains("more than 20000000 numbers"));
    assert!(refusal_text(&",".repeat(100_000_000)).contains("it has 100000001 columns"));
}

#[test]
fn a_row_of_too_many_numbers_is_one_mistake() {
    let report = Report::default();
    let source = report.add("list.csv", String::new());
    let text = format!("a,b\n{}\n1,2\n", ",".repeat(100_000_000));
    assert!(csv::read(&text, source, false, &ANY_NAMES, &report).is_ok());
    assert_eq!(report.into_diagnostics().count(), 1);
}

#[test]
fn the_location_of_a_value_is_its_cell() {
    let text = "\u{feff}# by hand\r\n a , \"b\"\r\n\r\n 1,2 \r\n3 , \"4\"\r\n";
    let csv::TextTable { columns, row_starts, separator: by, .. } = read_csv(text).unwrap();
    assert_eq!([&columns[0].values, &columns[1].values], [&[1.0, 3.0], &[2.0, 4.0]]);
    let cell = |row: usize, column| &text[cell_span(text, row_starts[row] as usize, by, column)];
    assert_eq!([cell(0, 0), cell(0, 1), cell(1, 0), cell(1, 1)], ["1", "2", "3", "\"4\""]);
    assert_eq!(
        [
            &text[columns[0].name.location.span.clone()],
            &text[columns[1].name.location.span.clone()]
        ],
        ["a", "\"b\""]
    );
}

#[test]
fn a_quoted_cell_may_contain_the_separator() {
    let text = "id,b\n\"a,b\",2\n\"5\"\" pipe, short\",3\n5\" pipe,4\n";
    let csv::TextTable { columns, .. } = read_csv(text).unwrap();
    assert_eq!(columns[1].values, [2.0, 3.0, 4.0]);
}

#[test]
fn semicolons_tabs_and_decimal_commas_are_read() {
    for text in ["a;b\n1,5;2\n3;-4,25e2\n", "a\tb\n1.5\t2\n3\t-425\n"] {
        let csv::TextTable { columns, row_starts, separator: by, .. } = read_csv(text).unwrap();
        assert_eq!([&columns[0].values, &columns[1].values], [&[1.5, 3.0], &[2.0, -425.0]]);
        assert_eq!(text[cell_span(text, row_starts[0] as usize, by, 1)], *"2");
    }
    let report = Report::default();
    let source = report.add("list.csv", String::new());
    assert!(csv::read("a;b\n1;2;3\n", source, false, &ANY_NAMES, &report).is_ok());
    let message = report.into_diagnostics().to_string();
    assert!(message.contains("expected 2 numbers, separated by semicolons"), "{message}");
}

#[test]
fn a_file_has_one_decimal_mark() {
    let german = "unbalance_mass_kg;damping_n_s_per_m\n0,9;950,0\n0,9;1.050\n";
    let american = "unbalance_mass_kg\tdamping_n_s_per_m\n0.9\t950\n0.9\t1,050\n";
    let quoted = "unbalance_mass_kg,damping_n_s_per_m\n0.9,950\n0.9,\"1,050\"\n";
    for text in [german, american, quoted] {
        let csv::TextTable { columns, .. } = read_csv(text).unwrap();
        assert_eq!([&columns[0].values, &columns[1].values], [&[0.9, 0.9], &[950.0, 1050.0]]);
    }
    let commas = "a,b\n1.050,950\n\"1.100\",970\n";
    assert_eq!(read_csv(commas).unwrap().columns[0].values, [1.05, 1.1]);
    let message = |text: &str| {
        let report = Report::default();
        let source = report.add("list.csv", String::new());
        let table = csv::read(text, source, true, &ANY_NAMES, &report);
        report.set_text(source, text.to_owned());
        assert!(table.unwrap().columns.iter().all(|column| column.values.is_empty()));
        report.into_diagnostics().to_string()
    };
    let mixed_marks = message("a;b\n0,9;950\n0.9;1050\n");
    for part in ["decimal points, as in `0.9`", "commas, as in `0,9`", ":2:1", ":3:1", "the same"] {
        assert!(mixed_marks.contains(part), "{part}: {mixed_marks}");
    }
    let unclear_mark = message("a;b\n2;950\n3;1.050\n");
    for part in ["`1.050` may be 1050 or 1.050", ":3:3", "write 1050, or 1.0500"] {
        assert!(unclear_mark.contains(part), "{part}: {unclear_mark}");
    }
    assert!(message("a\n950\n1.050\n").contains("may be 1050"));
}

/// Returns the columns of a logger's file for a reader of four names with units, and the notes.
fn read_logger_file(bytes: &[u8]) -> (Vec<(String, Vec<f64>)>, Vec<String>) {
    const KNOWN: [(&str, &str); 4] =
        [("time_s", "s"), ("speed_rpm", "rpm"), ("arm_yaw_rad", "rad"), ("acc_m_per_s2", "m/s^2")];
    let known = |name: &str| {
        let found = KNOWN.iter().find(|(known, _)| *known == name);
        found.map(|(name, unit)| ((*name).to_owned(), (*unit).to_owned()))
    };
    let renamed = [("Acc front".to_owned(), "acc_m_per_s2".to_owned())];
    let names = ColumnNames { known: &known, renamed: &renamed };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("logger.csv");
    std::fs::write(&path, bytes).unwrap();
    let report = Report::default();
    let table = NumberTable::read(&path, &names, &report);
    let Some(table) = table else { panic!("{}", report.into_diagnostics()) };
    let notes = table.notes();
    let known = table.columns.into_iter().filter(|column| column.is_known);
    (known.map(|column| (column.name.value, column.values)).collect(), notes)
}

#[test]
fn files_of_loggers_and_spreadsheets_are_read() {
    let expected_text = "time_s,arm_yaw_rad\n0,0.5\n0.02,-0.25\n";
    let utf16 = format!("\u{feff}{}", expected_text.replace(',', "\t"));
    let utf16: Vec<u8> = utf16.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let texts = [
        expected_text.to_owned(),
        expected_text.replace('\n', "\r"),
        expected_text.replace('\n', "\r\n"),
        format!("Logger 7\nRate,50 Hz\n\n{expected_text}"),
        format!("Name,abc\nRate,50\n{expected_text}"),
        expected_text.replace("rad\n", "rad\ns,rad\n"),
        expected_text.replace("rad\n", "rad\n[s],[rad]\n"),
        expected_text.replace('\n', ",\n"),
        format!("{expected_text},\n,\n"),
        format!("sep=;\n{}", expected_text.replace(',', ";").replace('.', ",")),
        "time_s,arm_yaw_rad\n\"0\",\"0,5\"\n\"0,02\",\"-0,25\"\n".to_owned(),
        expected_text.replace(',', "  "),
        format!("# {expected_text}"),
        ",time_s,arm_yaw_rad\n0,0,0.5\n1,0.02,-0.25\n".to_owned(),
        "time_s,temp_c,arm_yaw_rad,note\n0,21,0.5,a b\n0.02,warm,-0.25,\n".to_owned(),
        "Time [ms],Arm yaw [rad]\n0,0.5\n20,-0.25\n".to_owned(),
        "Time;Arm yaw\nms;rad\n0;0,5\n20;-0,25\n".to_owned(),
    ];
    let files = texts.iter().map(|text| text.as_bytes().to_vec()).chain([utf16]);
    for bytes in files {
        let file_text = String::from_utf8_lossy(&bytes).into_owned();
        let (columns, _) = read_logger_file(&bytes);
        let expected = [("time_s", vec![0.0, 0.02]), ("arm_yaw_rad", vec![0.5, -0.25])];
        let expected = expected.map(|(name, values)| (name.to_owned(), values));
        assert_eq!(columns, expected, "{file_text}");
    }
}

#[test]
fn a_name_of_several_words_is_one_column() {
    let (columns, _) = read_logger_file(b"Arm yaw [rad]\n0.5\n-0.25\n");
    assert_eq!(columns, [("arm_yaw_rad".to_owned(), vec![0.5, -0.25])]);
}

#[test]
fn ignored_and_renamed_columns_are_noted() {
    let text = "Logger 7\nTime [s];Acc front [g];Temp [\u{b0}C];n (Hz)\n0,0;1,0;21,5;2\n";
    let latin: Vec<u8> = text.chars().map(|letter| letter as u8).collect();
    let (columns, notes) = read_logger_file(&latin);
    assert_eq!(columns[1], ("acc_m_per_s2".to_owned(), vec![9.80665]));
    let notes = notes.join("\n");
    for message in
        ["1 line before the names", "`Temp [\u{b0}C]`, `n (Hz)`", "`Acc front [g]` is acc"]
    {
        assert!(notes.contains(message), "{message}: {notes}");
    }
}

#[test]
fn a_labview_file_is_read_with_its_units_and_its_decimal_mark() {
    let header = "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\n\
        Decimal_Separator\t,\nMulti_Headings\tNo\nX_Columns\tOne\nTime_Pref\tRelative\n\
        Date\t2026/03/01\n***End_of_Header***\t\n\t\nChannels\t2\t\t\nSamples\t2\t2\t\n\
        Y_Unit_Label\tg\tVolts\t\nX_Dimension\tTime\tTime\t\nX0\t0,0\t0,0\t\n\
        Delta_X\t0,001\t0,001\t\n***End_of_Header***\t\t\t\n\
        X_Value\tAcc front\tVoltage\tComment\n";
    let text = format!("{header}0,000000\t1,500\t2,0\n0,001000\t-1,250\t2,0\tstart\n");
    let (columns, _) = read_logger_file(text.as_bytes());
    let expected = [1.5, -1.25].map(|g| g * 9.80665).to_vec();
    assert_eq!(columns[0], ("time_s".to_owned(), vec![0.0, 0.001]));
    assert_eq!(columns[1], ("acc_m_per_s2".to_owned(), expected));
    let refusal_text = |text: &str| read_csv(text).map(|_| ()).unwrap_err();
    assert!(refusal_text(&header.replace("X_Columns\tOne", "X_Columns\tMulti")).contains("Multi"));
    assert!(refusal_text(&format!("{text}{header}")).contains("several segments"));
}

#[test]
fn index_and_unknown_columns_of_parquet_lists_are_ignored() {
    let masses: ArrayRef = Arc::new(Float64Array::from(vec![300.0, 400.0]));
    let index: ArrayRef = Arc::new(UInt64Array::from(vec![3, 7]));
    let words: ArrayRef = Arc::new(["a", "b"].into_iter().collect::<DictionaryArray<Int32Type>>());
    let columns = [("unbalance_mass_g", masses), ("note", words), ("__index_level_0__", index)];
    let bytes = file(&columns, 1, WriterProperties::default());
    let known = |name: &str| (name == NAME).then(|| (NAME.to_owned(), "kg".to_owned()));
    let names = ColumnNames { known: &known, renamed: &[] };
    let read = parquet::read_columns(bytes, false, &names).unwrap();
    assert_eq!((read[0].name.as_str(), read[0].values.as_deref()), (NAME, Some(&[0.3, 0.4][..])));
    assert_eq!((read.len(), read[1].name.as_str(), &read[1].values), (2, "note", &None));
}

#[test]
fn parquet_decimals_are_numbers() {
    use ::parquet::data_type::{FixedLenByteArrayType, Int32Type, Int64Type};
    use ::parquet::file::writer::SerializedFileWriter;
    use ::parquet::schema::parser::parse_message_type;
    let schema = "message m { required int32 a (DECIMAL(4,1)); required int64 b (DECIMAL(18,3)); \
        required fixed_len_byte_array(5) c (DECIMAL(10,2)); }";
    let schema = Arc::new(parse_message_type(schema).unwrap());
    let mut bytes = Vec::new();
    let mut writer = SerializedFileWriter::new(&mut bytes, schema, Arc::default()).unwrap();
    let mut group = writer.next_row_group().unwrap();
    let mut column = group.next_column().unwrap().unwrap();
    column.typed::<Int32Type>().write_batch(&[1205, -5], None, None).unwrap();
    column.close().unwrap();
    let mut column = group.next_column().unwrap().unwrap();
    column.typed::<Int64Type>().write_batch(&[300, 12_345], None, None).unwrap();
    column.close().unwrap();
    let mut column = group.next_column().unwrap().unwrap();
    let cells = [vec![0, 0, 0, 1, 0], vec![255, 255, 255, 255, 156]].map(Into::into);
    column.typed::<FixedLenByteArrayType>().write_batch(&cells, None, None).unwrap();
    column.close().unwrap();
    group.close().unwrap();
    writer.close().unwrap();
    let values_by_column: Vec<Vec<f64>> =
        read_parquet(bytes).unwrap().into_iter().map(|(_, values)| values).collect();
    assert_eq!(values_by_column, [vec![120.5, -0.5], vec![0.3, 12.345], vec![2.56, -1.0]]);
}

#[test]
fn instants_and_times_of_day_of_parquet_files_are_seconds() {
    use ::parquet::data_type::Int64Type;
    use ::parquet::file::writer::SerializedFileWriter;
    use ::parquet::schema::parser::parse_message_type;
    let known = |name: &str| {
        let quantity = match name {
            "time" => ["time_s", "s"],
            NAME => [NAME, "kg"],
            _ => return None,
        };
        Some(quantity.map(str::to_owned).into())
    };
    let names = ColumnNames { known: &known, renamed: &[] };
    let read = |name: &str, kind: &str, cells: &[i64]| {
        let schema = format!(
            "message m {{ required int64 {name} {kind}; \
             required int64 logged_at (TIMESTAMP(NANOS,true)); }}"
        );
        let schema = Arc::new(parse_message_type(&schema).unwrap());
        let mut bytes = Vec::new();
        let mut writer = SerializedFileWriter::new(&mut bytes, schema, Arc::default()).unwrap();
        let mut group = writer.next_row_group().unwrap();
        for _ in 0..2 {
            let mut column = group.next_column().unwrap().unwrap();
            column.typed::<Int64Type>().write_batch(cells, None, None).unwrap();
            column.close().unwrap();
        }
        group.close().unwrap();
        writer.close().unwrap();
        parquet::read_columns(bytes, true, &names)
    };
    // 2026-03-01 12:34:56.789
    let instant_ns = 1_772_368_496_789_000_000;
    let instant_s = 1_772_368_496.789;
    let day_time_ns = instant_ns % 86_400_000_000_000;
    for (kind, cell, seconds) in [
        ("(TIMESTAMP(NANOS,false))", instant_ns, instant_s),
        ("(TIMESTAMP(MICROS,true))", instant_ns / 1000, instant_s),
        ("(TIMESTAMP_MILLIS)", instant_ns / 1_000_000, instant_s),
        ("(TIMESTAMP_MICROS)", instant_ns / 1000, instant_s),
        ("(TIME(MICROS,false))", day_time_ns / 1000, 45_296.789),
        ("(TIME(NANOS,false))", day_time_ns, 45_296.789),
        ("", 5, 5.0),
    ] {
        let columns = read("time", kind, &[cell]).unwrap();
        let [time, logged_at] = columns.as_slice() else { panic!("{columns:?}") };
        assert_eq!(time.values.as_deref(), Some(&[seconds][..]), "{kind}");
        assert_eq!((time.is_clock, &logged_at.values), (!kind.is_empty(), &None), "{kind}");
    }
    // Other quantities are no instants.
    let refused = read(NAME, "(TIMESTAMP(NANOS,false))", &[instant_ns]).unwrap_err();
    assert!(refused.contains("holds no numbers but dates, times"), "{refused}");
}

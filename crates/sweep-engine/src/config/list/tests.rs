//! Tests of lists: compressions, bounds, damaged files, and files of loggers.

use std::sync::Arc;

use ::parquet::basic::{Compression, GzipLevel, ZstdLevel};
use ::parquet::file::properties::{WriterProperties, WriterVersion};
use arrow_array::types::Int32Type;
use arrow_array::{ArrayRef, DictionaryArray, Float64Array, RecordBatch, UInt64Array};
use sweep_files::Writer;

use super::*;

const MASS_COLUMN: &str = "unbalance_mass_kg";

/// Names that are all known and have no unit.
const ALL_NAMES_KNOWN: ColumnNames<'_> = ColumnNames {
    find_quantity: &|name: &str| Some((name.to_owned(), String::new())),
    renamed_headers: &[],
};

/// Returns the known columns of a Parquet file.
fn read_parquet(bytes: Vec<u8>) -> Result<Vec<(String, Vec<f64>)>, ListError> {
    let columns = parquet::read_columns(bytes, false, &ALL_NAMES_KNOWN)?;
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
fn parquet_file(
    columns: &[(&str, ArrayRef)],
    batches: usize,
    properties: WriterProperties,
) -> Vec<u8> {
    let batch = RecordBatch::try_from_iter(columns.iter().cloned()).unwrap();
    let mut bytes = Vec::new();
    let mut writer = Writer::new(&mut bytes, &batch.schema(), properties).unwrap();
    for _ in 0..batches {
        writer.write(&batch).unwrap();
    }
    writer.end().unwrap().close().unwrap();
    bytes
}

fn compressed_properties(codec: Compression, version: WriterVersion) -> WriterProperties {
    WriterProperties::builder().set_compression(codec).set_writer_version(version).build()
}

/// Returns a file with a column of masses and a column of whole numbers.
fn small_file(codec: Compression, version: WriterVersion) -> Vec<u8> {
    let masses = (0..300).map(|k| 0.1 + 0.001 * f64::from(k % 50)).collect::<Vec<_>>();
    let frames = (0..300).map(|k| 20 + k % 7).collect::<Vec<_>>();
    let masses: ArrayRef = Arc::new(Float64Array::from(masses));
    let frames: ArrayRef = Arc::new(UInt64Array::from(frames));
    parquet_file(
        &[(MASS_COLUMN, masses), ("frame_mass_kg", frames)],
        1,
        compressed_properties(codec, version),
    )
}

fn list_error(bytes: Vec<u8>) -> String {
    read_parquet(bytes).expect_err("not a list")
}

#[test]
fn supported_compressions_give_the_same_numbers() {
    let expected_columns = small_file(Compression::UNCOMPRESSED, WriterVersion::PARQUET_1_0);
    let expected_columns = read_parquet(expected_columns).unwrap();
    assert_eq!((expected_columns[0].1[49], expected_columns[1].1[6]), (0.1 + 0.001 * 49.0, 26.0));
    for codec in supported_codecs() {
        for version in [WriterVersion::PARQUET_1_0, WriterVersion::PARQUET_2_0] {
            let columns = read_parquet(small_file(codec, version));
            assert_eq!(columns.unwrap(), expected_columns, "{codec}, {version:?}");
        }
    }
}

#[test]
fn an_unsupported_compression_is_named_with_the_supported_ones() {
    let snappy_file = small_file(Compression::SNAPPY, WriterVersion::PARQUET_1_0);
    // The codec of a column follows its name in the metadata, as an i32.
    let codec_pattern = [MASS_COLUMN.as_bytes(), &[0x15, 0x02]].concat();
    let pattern_start =
        snappy_file.windows(codec_pattern.len()).position(|window| window == codec_pattern);
    let codec_pattern = pattern_start.unwrap() + codec_pattern.len() - 1;
    for (code, name) in [(3, "lzo"), (4, "brotli"), (5, "lz4")] {
        let mut changed_file = snappy_file.clone();
        changed_file[codec_pattern] = 2 * code;
        let message = list_error(changed_file);
        let expected =
            format!("`{MASS_COLUMN}` is compressed by {name}, which this program does not");
        assert!(message.contains(&expected) && message.contains("snappy, zstd, gzip"), "{message}");
    }
}

#[test]
fn columns_without_numbers_are_named() {
    let text_column: ArrayRef = Arc::new(["a"].into_iter().collect::<DictionaryArray<Int32Type>>());
    let column_with_null: ArrayRef = Arc::new(Float64Array::from(vec![Some(1.0), None]));
    let error_message = |column: ArrayRef| {
        list_error(parquet_file(&[("x", column)], 1, WriterProperties::default()))
    };
    assert!(error_message(text_column).contains("`x` holds no numbers but text"));
    assert!(error_message(column_with_null).contains("`x` has no value in row 2"));
}

#[test]
fn a_small_file_with_too_many_rows_is_rejected_unread() {
    let number_column: ArrayRef = Arc::new(Float64Array::from(vec![1.0; 1_000_000]));
    let properties = compressed_properties(Compression::SNAPPY, WriterVersion::PARQUET_1_0);
    let bytes =
        parquet_file(&[("x", number_column)], 1 + (MAX_NUMBERS / 1_000_000) as usize, properties);
    assert!(bytes.len() < 1_000_000, "{}", bytes.len());
    assert!(list_error(bytes).contains("more than 20000000 numbers"));
}

#[test]
fn a_damaged_file_gives_an_error_or_a_list() {
    for codec in supported_codecs() {
        let undamaged_file = small_file(codec, WriterVersion::PARQUET_2_0);
        for length in (0..undamaged_file.len()).step_by(7) {
            assert!(
                read_parquet(undamaged_file[..length].to_vec()).is_err(),
                "{codec}: {length} bytes"
            );
        }
        for byte_index in 0..undamaged_file.len() {
            for bit in [0, 3, 7] {
                let mut flipped_file = undamaged_file.clone();
                flipped_file[byte_index] ^= 1 << bit;
                if let Ok(columns) = read_parquet(flipped_file) {
                    assert!(columns.iter().all(|(_, values)| values.len() as u64 <= MAX_NUMBERS));
                }
            }
        }
    }
}

/// Returns the position of a cell in the line that begins at a byte of a text.
fn cell_span(text: &str, start: usize, separator: char, column: usize) -> std::ops::Range<usize> {
    TextLine::starting_at(text, start).cells(separator).nth(column).expect("it is there").1
}

fn read_csv(text: &str) -> Result<csv::TextTable, ListError> {
    let report = Report::default();
    let source = report.add("list.csv", String::new());
    csv::read_text_table(text, source, false, &ALL_NAMES_KNOWN, &report)
}

#[test]
fn a_text_with_too_many_numbers_or_columns_is_rejected() {
    let row_lines = "1,2\n".repeat((MAX_NUMBERS / 2) as usize);
    let csv::TextTable { columns, row_starts, .. } =
        read_csv(&format!("a,b\n{row_lines}")).unwrap();
    assert_eq!((columns[1].values.len(), row_starts.len()), (10_000_000, 10_000_000));
    let refusal_text = |text: &str| read_csv(text).map(|_| ()).unwrap_err().to_string();
    assert!(refusal_text(&format!("a,b\n{row_lines}1,2\n")).contains("more than 20000000 numbers"));
    assert!(refusal_text(&",".repeat(100_000_000)).contains("it has 100000001 columns"));
}

#[test]
fn a_row_of_too_many_numbers_is_one_mistake() {
    let report = Report::default();
    let source = report.add("list.csv", String::new());
    let text = format!("a,b\n{}\n1,2\n", ",".repeat(100_000_000));
    assert!(csv::read_text_table(&text, source, false, &ALL_NAMES_KNOWN, &report).is_ok());
    assert_eq!(report.into_diagnostics().count(), 1);
}

#[test]
fn the_location_of_a_value_is_its_cell() {
    let text = "\u{feff}# by hand\r\n a , \"b\"\r\n\r\n 1,2 \r\n3 , \"4\"\r\n";
    let csv::TextTable { columns, row_starts, separator: used_separator, .. } =
        read_csv(text).unwrap();
    assert_eq!([&columns[0].values, &columns[1].values], [&[1.0, 3.0], &[2.0, 4.0]]);
    let cell_text = |row: usize, column| {
        &text[cell_span(text, row_starts[row] as usize, used_separator, column)]
    };
    assert_eq!(
        [cell_text(0, 0), cell_text(0, 1), cell_text(1, 0), cell_text(1, 1)],
        ["1", "2", "3", "\"4\""]
    );
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
        let csv::TextTable { columns, row_starts, separator: used_separator, .. } =
            read_csv(text).unwrap();
        assert_eq!([&columns[0].values, &columns[1].values], [&[1.5, 3.0], &[2.0, -425.0]]);
        assert_eq!(text[cell_span(text, row_starts[0] as usize, used_separator, 1)], *"2");
    }
    let report = Report::default();
    let source = report.add("list.csv", String::new());
    assert!(csv::read_text_table("a;b\n1;2;3\n", source, false, &ALL_NAMES_KNOWN, &report).is_ok());
    let message = report.into_diagnostics().to_string();
    assert!(message.contains("expected 2 numbers, separated by semicolons"), "{message}");
}

#[test]
fn a_file_has_one_decimal_mark() {
    let german_text = "unbalance_mass_kg;damping_n_s_per_m\n0,9;950,0\n0,9;1.050\n";
    let american_text = "unbalance_mass_kg\tdamping_n_s_per_m\n0.9\t950\n0.9\t1,050\n";
    let quoted_text = "unbalance_mass_kg,damping_n_s_per_m\n0.9,950\n0.9,\"1,050\"\n";
    for text in [german_text, american_text, quoted_text] {
        let csv::TextTable { columns, .. } = read_csv(text).unwrap();
        assert_eq!([&columns[0].values, &columns[1].values], [&[0.9, 0.9], &[950.0, 1050.0]]);
    }
    let comma_separated_text = "a,b\n1.050,950\n\"1.100\",970\n";
    assert_eq!(read_csv(comma_separated_text).unwrap().columns[0].values, [1.05, 1.1]);
    let mistakes_of = |text: &str| {
        let report = Report::default();
        let source = report.add("list.csv", String::new());
        let table = csv::read_text_table(text, source, true, &ALL_NAMES_KNOWN, &report);
        report.set_text(source, text.to_owned());
        assert!(table.unwrap().columns.iter().all(|column| column.values.is_empty()));
        report.into_diagnostics().to_string()
    };
    let mixed_marks_message = mistakes_of("a;b\n0,9;950\n0.9;1050\n");
    for part in ["decimal points, as in `0.9`", "commas, as in `0,9`", ":2:1", ":3:1", "the same"] {
        assert!(mixed_marks_message.contains(part), "{part}: {mixed_marks_message}");
    }
    let unclear_mark_message = mistakes_of("a;b\n2;950\n3;1.050\n");
    for part in ["`1.050` may be 1050 or 1.050", ":3:3", "write 1050, or 1.0500"] {
        assert!(unclear_mark_message.contains(part), "{part}: {unclear_mark_message}");
    }
    assert!(mistakes_of("a\n950\n1.050\n").contains("may be 1050"));
}

/// Returns the columns of a logger's file for a reader of four names with units, and the notes.
fn read_logger_file(bytes: &[u8]) -> (Vec<(String, Vec<f64>)>, Vec<String>) {
    const KNOWN_QUANTITIES: [(&str, &str); 4] =
        [("time_s", "s"), ("speed_rpm", "rpm"), ("arm_yaw_rad", "rad"), ("acc_m_per_s2", "m/s^2")];
    let known = |name: &str| {
        let known_quantity = KNOWN_QUANTITIES.iter().find(|(known, _)| *known == name);
        known_quantity.map(|(name, unit)| ((*name).to_owned(), (*unit).to_owned()))
    };
    let renamed_headers = [("Acc front".to_owned(), "acc_m_per_s2".to_owned())];
    let column_names = ColumnNames { find_quantity: &known, renamed_headers: &renamed_headers };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("logger.csv");
    std::fs::write(&path, bytes).unwrap();
    let report = Report::default();
    let table = NumberTable::read_point_list(&path, &column_names, &report);
    let Some(table) = table else { panic!("{}", report.into_diagnostics()) };
    let notes = table.notes();
    let known = table.columns.into_iter().filter(|column| column.is_known);
    (known.map(|column| (column.name.value, column.values)).collect(), notes)
}

#[test]
fn files_of_loggers_and_spreadsheets_are_read() {
    let expected_text = "time_s,arm_yaw_rad\n0,0.5\n0.02,-0.25\n";
    let utf16_bytes = format!("\u{feff}{}", expected_text.replace(',', "\t"));
    let utf16_bytes: Vec<u8> = utf16_bytes.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let equivalent_texts = [
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
    let equivalent_files =
        equivalent_texts.iter().map(|text| text.as_bytes().to_vec()).chain([utf16_bytes]);
    for bytes in equivalent_files {
        let file_text = String::from_utf8_lossy(&bytes).into_owned();
        let (columns, _) = read_logger_file(&bytes);
        let expected_columns = [("time_s", vec![0.0, 0.02]), ("arm_yaw_rad", vec![0.5, -0.25])];
        let expected_columns = expected_columns.map(|(name, values)| (name.to_owned(), values));
        assert_eq!(columns, expected_columns, "{file_text}");
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
    let latin1_bytes: Vec<u8> = text.chars().map(|letter| letter as u8).collect();
    let (columns, notes) = read_logger_file(&latin1_bytes);
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
    let header_text = "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\n\
        Decimal_Separator\t,\nMulti_Headings\tNo\nX_Columns\tOne\nTime_Pref\tRelative\n\
        Date\t2026/03/01\n***End_of_Header***\t\n\t\nChannels\t2\t\t\nSamples\t2\t2\t\n\
        Y_Unit_Label\tg\tVolts\t\nX_Dimension\tTime\tTime\t\nX0\t0,0\t0,0\t\n\
        Delta_X\t0,001\t0,001\t\n***End_of_Header***\t\t\t\n\
        X_Value\tAcc front\tVoltage\tComment\n";
    let text = format!("{header_text}0,000000\t1,500\t2,0\n0,001000\t-1,250\t2,0\tstart\n");
    let (columns, _) = read_logger_file(text.as_bytes());
    let expected_accelerations = [1.5, -1.25].map(|g| g * 9.80665).to_vec();
    assert_eq!(columns[0], ("time_s".to_owned(), vec![0.0, 0.001]));
    assert_eq!(columns[1], ("acc_m_per_s2".to_owned(), expected_accelerations));
    let refusal_text = |text: &str| read_csv(text).map(|_| ()).unwrap_err();
    assert!(
        refusal_text(&header_text.replace("X_Columns\tOne", "X_Columns\tMulti")).contains("Multi")
    );
    assert!(refusal_text(&format!("{text}{header_text}")).contains("several segments"));
}

#[test]
fn index_and_unknown_columns_of_parquet_lists_are_ignored() {
    let masses: ArrayRef = Arc::new(Float64Array::from(vec![300.0, 400.0]));
    let index: ArrayRef = Arc::new(UInt64Array::from(vec![3, 7]));
    let words: ArrayRef = Arc::new(["a", "b"].into_iter().collect::<DictionaryArray<Int32Type>>());
    let columns = [("unbalance_mass_g", masses), ("note", words), ("__index_level_0__", index)];
    let bytes = parquet_file(&columns, 1, WriterProperties::default());
    let known =
        |name: &str| (name == MASS_COLUMN).then(|| (MASS_COLUMN.to_owned(), "kg".to_owned()));
    let names = ColumnNames { find_quantity: &known, renamed_headers: &[] };
    let columns_read = parquet::read_columns(bytes, false, &names).unwrap();
    assert_eq!(
        (columns_read[0].name.as_str(), columns_read[0].values.as_deref()),
        (MASS_COLUMN, Some(&[0.3, 0.4][..]))
    );
    assert_eq!(
        (columns_read.len(), columns_read[1].name.as_str(), &columns_read[1].values),
        (2, "note", &None)
    );
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
    let mut row_group = writer.next_row_group().unwrap();
    let mut column = row_group.next_column().unwrap().unwrap();
    column.typed::<Int32Type>().write_batch(&[1205, -5], None, None).unwrap();
    column.close().unwrap();
    let mut column = row_group.next_column().unwrap().unwrap();
    column.typed::<Int64Type>().write_batch(&[300, 12_345], None, None).unwrap();
    column.close().unwrap();
    let mut column = row_group.next_column().unwrap().unwrap();
    let decimal_bytes = [vec![0, 0, 0, 1, 0], vec![255, 255, 255, 255, 156]].map(Into::into);
    column.typed::<FixedLenByteArrayType>().write_batch(&decimal_bytes, None, None).unwrap();
    column.close().unwrap();
    row_group.close().unwrap();
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
        let name_and_unit = match name {
            "time" => ["time_s", "s"],
            MASS_COLUMN => [MASS_COLUMN, "kg"],
            _ => return None,
        };
        Some(name_and_unit.map(str::to_owned).into())
    };
    let names = ColumnNames { find_quantity: &known, renamed_headers: &[] };
    let read_time_columns = |name: &str, column_type: &str, cells: &[i64]| {
        let schema = format!(
            "message m {{ required int64 {name} {column_type}; \
             required int64 logged_at (TIMESTAMP(NANOS,true)); }}"
        );
        let schema = Arc::new(parse_message_type(&schema).unwrap());
        let mut bytes = Vec::new();
        let mut writer = SerializedFileWriter::new(&mut bytes, schema, Arc::default()).unwrap();
        let mut row_group = writer.next_row_group().unwrap();
        for _ in 0..2 {
            let mut column = row_group.next_column().unwrap().unwrap();
            column.typed::<Int64Type>().write_batch(cells, None, None).unwrap();
            column.close().unwrap();
        }
        row_group.close().unwrap();
        writer.close().unwrap();
        parquet::read_columns(bytes, true, &names)
    };
    // 2026-03-01 12:34:56.789
    let instant_ns = 1_772_368_496_789_000_000;
    let instant_s = 1_772_368_496.789;
    let day_time_ns = instant_ns % 86_400_000_000_000;
    for (column_type, cell, seconds) in [
        ("(TIMESTAMP(NANOS,false))", instant_ns, instant_s),
        ("(TIMESTAMP(MICROS,true))", instant_ns / 1000, instant_s),
        ("(TIMESTAMP_MILLIS)", instant_ns / 1_000_000, instant_s),
        ("(TIMESTAMP_MICROS)", instant_ns / 1000, instant_s),
        ("(TIME(MICROS,false))", day_time_ns / 1000, 45_296.789),
        ("(TIME(NANOS,false))", day_time_ns, 45_296.789),
        ("", 5, 5.0),
    ] {
        let columns = read_time_columns("time", column_type, &[cell]).unwrap();
        let [time, logged_at] = columns.as_slice() else { panic!("{columns:?}") };
        assert_eq!(time.values.as_deref(), Some(&[seconds][..]), "{column_type}");
        assert_eq!(
            (time.is_clock, &logged_at.values),
            (!column_type.is_empty(), &None),
            "{column_type}"
        );
    }
    // Other quantities are no instants.
    let refusal =
        read_time_columns(MASS_COLUMN, "(TIMESTAMP(NANOS,false))", &[instant_ns]).unwrap_err();
    assert!(refusal.contains("holds no numbers but dates, times"), "{refusal}");
}

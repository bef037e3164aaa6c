#pragma once
#include <array>

#include "analysis/record/record.hpp"
#include "analysis/record/series/series.hpp"
#include "analysis/record/series/series_rows.hpp"
#include "analysis/text/words.hpp"

/// The kinds of file behind read_series and read_record.
namespace ringlock::record {

/// All leave it to the caller that a value is there, and find a rate where there are time stamps.
SeriesInfo stream_text_series(const SeriesRequest& request, const TakePiece& take);
SeriesInfo stream_hdf5_series(const SeriesRequest& request, const TakePiece& take);
SeriesInfo stream_npy_series(const SeriesRequest& request, const TakePiece& take);
SeriesInfo stream_npz_series(const SeriesRequest& request, const TakePiece& take);
SeriesInfo stream_mat_series(const SeriesRequest& request, const TakePiece& take);

/// Both leave check() to the caller. `file` is HDF5.
Record read_csv_record(const std::string& path);
Record read_hdf5_record(const std::string& path, store::Links links);

/// Names of the witnesses that samples may have.
inline constexpr std::array<const char*, 4> witness_names = {"accel_x", "accel_y", "accel_z", "temperature_c"};

/// Names of /declared.
struct DeclaredName {
    const char* name;
    std::optional<double> Declared::*field;
};
inline constexpr std::array<DeclaredName, 8> declared_names = {
    {{"scale_factor_arcsec", &Declared::scale_factor_arcsec},
     {"lockin_threshold_deg_h", &Declared::lockin_threshold_deg_h},
     {"dither_frequency_hz", &Declared::dither_frequency_hz},
     {"dither_peak_rate_deg_s", &Declared::dither_peak_rate_deg_s},
     {"bias_deg_h", &Declared::bias_deg_h},
     {"clock_hz", &Declared::clock_hz},
     {"readout_noise_rad", &Declared::readout_noise_rad},
     {"input_rate_deg_h", &Declared::input_rate_deg_h}}};

/// Numbers of /reader, by their names in the section [reader] of a scenario, and two that follow from these. The order
/// of the filter, a whole number, the stripping and the fraction, words, are apart.
struct ReaderName {
    const char* name;
    double& (*field)(DeclaredReader&);
};
inline constexpr std::array<ReaderName, 9> reader_names = {
    {{"latch_hz", [](DeclaredReader& r) -> double& { return r.settings.latch_hz; }},
     {"reference_gain_error_relative",
      [](DeclaredReader& r) -> double& { return r.settings.reference_gain_error_relative; }},
     {"reference_delay_s", [](DeclaredReader& r) -> double& { return r.settings.reference_delay_s; }},
     {"reference_noise_arcsec", [](DeclaredReader& r) -> double& { return r.settings.reference_noise_arcsec; }},
     {"reference_learning_s", [](DeclaredReader& r) -> double& { return r.settings.reference_learning_s; }},
     {"fir_cutoff_hz", [](DeclaredReader& r) -> double& { return r.settings.fir_cutoff_hz; }},
     {"notch_bandwidth_hz", [](DeclaredReader& r) -> double& { return r.settings.notch_bandwidth_hz; }},
     {"delay_s", [](DeclaredReader& r) -> double& { return r.delay_s; }},
     {"residue_relative", [](DeclaredReader& r) -> double& { return r.residue_relative; }}}};

inline constexpr std::array reader_words = {"stripping", "fraction"};

/// The reader's attribute of that name set from a text or a number; false where there is no such attribute. `wrong`
/// describes the error of the value, if it has one.
bool set_reader_word(DeclaredReader& reader, const std::string& name, const std::string& word, std::string& wrong);
bool set_reader_number(DeclaredReader& reader, const std::string& name, double value, std::string& wrong);

/// The optional texts at the root.
struct TextName {
    const char* name;
    std::string Record::*field;
};
inline constexpr std::array<TextName, 4> text_names = {{{"title", &Record::title},
                                                        {"instrument", &Record::instrument},
                                                        {"source", &Record::source},
                                                        {"licence", &Record::licence}}};

/// "angle_increment_arcsec", ...
const char* name_of(SampleKind kind);
inline constexpr std::array<SampleKind, 3> sample_kinds = {SampleKind::angle_increment_arcsec, SampleKind::angle_arcsec,
                                                           SampleKind::quarter_count};

inline constexpr const char* format_name = "rlg-record";
inline constexpr std::int64_t format_version = 1;

/// Bytes of memory that were free at the first call: before the columns of a record took some of them.
double memory_bytes();

using text::listed;

}  // namespace ringlock::record

#pragma once
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "engine/reader/settings.hpp"
#include "engine/store/atomic_file.hpp"

/// Measured data from files.
namespace ringlock::record {

/// The operator's statements about the instrument: a starting point, not truth.
struct Declared {
    std::optional<double> scale_factor_arcsec;  ///< K: arcsec of rotation per fringe, 2 pi of optical phase
    std::optional<double> lockin_threshold_deg_h;
    std::optional<double> dither_frequency_hz;
    std::optional<double> dither_peak_rate_deg_s;
    std::optional<double> bias_deg_h;
    std::optional<double> clock_hz;
    std::optional<double> readout_noise_rad;
    std::optional<double> input_rate_deg_h;
};

/// The reader that took samples, as far as it is known: its settings and the figures that follow from them.
struct DeclaredReader {
    reader::Settings settings;
    double delay_s = 0.0;           ///< by which the samples lag behind a steady rotation
    double residue_relative = 0.0;  ///< amplitude of a steady dither that is left over that of the dither
};

/// Consecutive zero-rate points, one row each.
struct Turns {
    std::vector<double> time_s;               ///< when the phase rate crosses zero
    std::vector<std::int8_t> direction;       ///< +1 at a phase minimum, -1 at a maximum
    std::vector<std::int64_t> quarter_count;  ///< up/down count of quarter fringes: floor(phase/(pi/2))
    std::vector<double> sine, cosine;         ///< quadrature detectors at the zero-rate point, any common scale
    std::vector<double> accel_before_rad_s2;  ///< magnitude of the phase acceleration from the nearest pulses on that
    std::vector<double> accel_after_rad_s2;   ///< side; 0 where none was seen

    std::size_t size() const { return time_s.size(); }
};

enum class SampleKind { angle_increment_arcsec, angle_arcsec, quarter_count };

/// Less than that is a record, but none that a closed loop can fit and predict.
constexpr std::size_t fewest_turns_to_close = 400;
constexpr std::size_t fewest_samples_to_close = 1000;

/// Uniform samples. A value of an angle or a witness that is missing is NaN; a count never is.
struct Samples {
    double rate_hz = 0.0;
    double t0_s = 0.0;
    SampleKind kind = SampleKind::angle_increment_arcsec;
    std::vector<double> values;                            ///< [arcsec]; empty for counts
    std::vector<std::int64_t> counts;                      ///< cumulative; of kind quarter_count only
    std::map<std::string, std::vector<double>> witnesses;  ///< accel_x, accel_y, accel_z, temperature_c: as long

    std::size_t size() const { return kind == SampleKind::quarter_count ? counts.size() : values.size(); }
};

/// A quantity at times of its own, linear between them.
struct Track {
    std::vector<double> time_s;
    std::vector<double> value;

    bool empty() const { return time_s.empty(); }
    /// Beyond the ends: the value there.
    double at(double time) const;
};

/// Samples that a text with time stamps leaves out.
struct Gap {
    std::size_t line = 0;   ///< of the row behind it, from 1
    std::size_t first = 0;  ///< sample that is missing first, from 0
    std::size_t samples = 0;
    std::string from, to;  ///< times of the rows before and behind it, with their unit
};

/// An rlg-record, version 1 (docs/record.md): turns, samples or both.
struct Record {
    std::string title, instrument, source, licence;
    Declared declared;
    std::optional<Turns> turns;
    std::optional<Samples> samples;
    std::optional<DeclaredReader> reader;  ///< of the samples
    Track temperature_c;                   ///< /environment
    Track input_rate_deg_h;                ///< /reference
    /// Names in the file that no record has, such as "/turns/note". They were ignored and are never written.
    std::vector<std::string> ignored;
    /// Likewise, where its samples are left out; the samples hold NaN there.
    std::vector<Gap> gaps;
};

/// Whether a file is HDF5, by its signature; a pipe is not. Throws InputError where it cannot be opened or is a folder.
bool is_hdf5(const std::string& path);
/// The root attribute `format` of an HDF5 file, which gives its kind; empty without this attribute.
std::string hdf5_format(const std::string& path, store::Links links = store::Links::refuse);

/// Reads the HDF5 or the CSV form, distinguished by their content. Throws InputError, naming file and dataset or line,
/// where the file cannot be read, is no record, or check() finds an error. Accelerations that the file leaves out are
/// zeros.
Record read_record(const std::string& path, store::Links links = store::Links::refuse);

/// The HDF5 form of a record, which appears whole or not at all.
class RecordWriter {
   public:
    /// Claims the file: before the work, not after it. Throws InputError where it cannot be written, or is there and no
    /// record: only another record is replaced.
    explicit RecordWriter(const std::string& path);

    /// Writes the record, unchecked, and gives the file its name; accelerations without any row are left out. Throws
    /// RunError where the disk refuses or another process has made or changed the file since it was claimed.
    void write(const Record& record);

   private:
    store::AtomicFile file_;
};

/// Claims the file and writes the record.
void write_record(const std::string& path, const Record& record);

enum class Severity {
    error,    ///< no record: reading refuses it
    warning,  ///< strange, but it may be so
};

/// One error or warning of a record, and its position.
struct Finding {
    std::string where;  ///< dataset, with the row, counted from 0, where there is one
    std::string what;   ///< value found and allowed values
    Severity severity = Severity::error;
};

/// Lengths, order, values that are not finite, counts that jump, turns that do not alternate, ... One finding a kind
/// and column: the first place, and how many there are. Samples that are missing are a warning; where more than half of
/// a column are, an error.
std::vector<Finding> check(const Record& record);

/// Throws InputError with the findings that are errors, `path` before each; does nothing without errors.
void refuse_errors(const std::string& path, const Record& record);

}  // namespace ringlock::record

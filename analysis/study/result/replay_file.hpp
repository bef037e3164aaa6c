#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "analysis/study/experiment.hpp"
#include "analysis/study/replay.hpp"
#include "engine/store/atomic_file.hpp"
#include "engine/store/provenance.hpp"

/// Gyros of a result that are replayed: their data in the result, and the file of the replay.
namespace ringlock::study {

inline constexpr std::int64_t replay_format_version = 1;

/// A gyro of one arm in a result.
struct GyroOfResult {
    std::filesystem::path result;  ///< its file
    const Experiment& experiment;  ///< as read from it
    std::size_t point = 0;
    std::size_t arm = 0;
    std::int64_t gyro = 0;  ///< of the point

    const Study& study() const { return experiment.points[point]; }
    const std::string& arm_name() const { return experiment.scenario.arms[arm].name; }
    /// "RESULT: point 2, arm ideal, gyro 3", without a design without the point.
    std::string text() const;
};

/// The data of a gyro that a result has stored, with which a replay is compared to the bit. A difference is a RunError
/// that says where it is, and by which programs the two were made.
class StoredGyro {
   public:
    /// `of` outlives it. Throws InputError where the result is damaged.
    explicit StoredGyro(const GyroOfResult& of);

    bool has_record() const { return opened_.record.has_value(); }
    /// Parameters as drawn.
    void check(const gyro::Setup& setup) const;
    /// A sample of the angle record; they come in their order. Nothing where the result has no records.
    void check_sample(std::int64_t sample, double angle_arcsec);
    /// Compares the figures of the whole record.
    void check(const ReplayFigures& figures) const;

   private:
    [[noreturn]] void fail(const std::string& what, double stored, double replayed) const;

    /// The file of the result and its datasets of this gyro.
    struct Opened {
        store::File file;  // closing a file closes its datasets, too
        store::Provenance provenance;
        std::optional<store::Dataset> record;
        std::uint64_t row = 0;  // of the gyro among those of all points
    };
    static Opened open(const GyroOfResult& of, const store::GuardedPath& guarded);
    static constexpr std::int64_t at_once = 65536;
    /// Samples of the record from `first` on, at most at_once.
    static std::vector<double> read_samples(const GyroOfResult& of, const Opened& opened, std::int64_t first);

    const GyroOfResult& of_;
    Opened opened_;
    std::int64_t first_read_ = 0;  // sample that the ones below begin with
    std::vector<double> read_;
};

/// Bytes that the file of a replay of so many turns takes at most; it is compressed.
std::uint64_t expected_replay_bytes(std::int64_t turns, bool pulses);

/// Writes a replay as it goes on. The file has its name only after finish().
class ReplayWriter final : public TurnSink {
   public:
    /// `of` outlives it. Claims the output. Throws InputError where it cannot be written, or where another file has the
    /// name: a replay of the same gyro, arm and result is replaced, anything else is kept.
    ReplayWriter(const std::filesystem::path& path, const GyroOfResult& of, const GyroReplay& replay,
                 const GyroReplay::Range& range);

    void take(std::span<const ReplayedTurn> turns) override;
    /// Writes everything else and gives the file its name.
    void finish(const ReplayFigures& figures, bool compared, const store::Provenance& of_replay);

    const std::filesystem::path& path() const { return file_.target(); }

   private:
    void flush();
    template <class Columns>
    void create(const Columns& columns, std::uint64_t rows);
    template <class Columns>
    void write(const Columns& columns, std::size_t& dataset);

    store::AtomicFile file_;
    const GyroOfResult& of_;
    std::vector<store::Dataset> datasets_;
    bool pulses_;
    std::vector<ReplayedTurn> waiting_;
    std::uint64_t written_ = 0;
};

}  // namespace ringlock::study

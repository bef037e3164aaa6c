#pragma once
#include <filesystem>
#include <mutex>
#include <optional>
#include <vector>

#include "analysis/study/experiment.hpp"
#include "analysis/study/summary.hpp"
#include "engine/store/atomic_file.hpp"
#include "engine/store/hdf5.hpp"
#include "engine/store/provenance.hpp"

/// The result file; results/FORMAT.md lists every dataset.
namespace ringlock::study {

inline constexpr std::int64_t result_format_version = 2;

/// Whether the file is the result of this scenario and seed. False for anything else, and where there is no file.
bool is_result_of(const std::filesystem::path& path, const Experiment& experiment);

/// Writes a result: its samples first, as they come, the rest at the end. The file has its name only after finish().
class ResultWriter {
   public:
    /// Claims the output. Throws InputError where it cannot be written, or where another study's result has the name:
    /// a result of the same scenario and seed is replaced, anything else is kept.
    ResultWriter(const std::filesystem::path& path, const Experiment& experiment);

    /// Writes samples of the angle output, where the scenario stores them. From any thread.
    void write_samples(const SampledAngles& samples);
    /// Writes everything else and gives the file its name.
    ///
    /// \param summaries  of its points, by summarise()
    void finish(const Experiment& experiment, const std::vector<Summary>& summaries,
                const store::Provenance& provenance);

    const std::filesystem::path& path() const { return file_.target(); }

   private:
    void begin();

    store::AtomicFile file_;
    scenario::Scenario scenario_;
    std::vector<Axis> axes_;
    std::vector<std::uint64_t> first_rows_;  // of each point's gyros, and how many there are
    std::uint64_t samples_;                  // of an angle record
    std::once_flag begun_;
    std::vector<store::Dataset> records_;  // one for each arm, or none
};

/// Bytes a result file of this experiment will take, but for some tens of kilobytes that hold names and units; with a
/// stopping rule, at most.
std::uint64_t expected_size_bytes(const Experiment& experiment);

/// Reads a result without its angle records. Throws InputError where the file is no result or is damaged.
Experiment read_result(const std::filesystem::path& path);

/// The provenance of a result.
store::Provenance read_provenance(const std::filesystem::path& path);

}  // namespace ringlock::study

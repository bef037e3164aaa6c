#pragma once
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "app/allan/output/density_output.hpp"
#include "app/allan/output/export.hpp"
#include "app/allan/request.hpp"
#include "app/allan/series.hpp"
#include "app/files.hpp"
#include "engine/core/atomic_path.hpp"

namespace ringlock::app {

/// The files that `ringlock allan` writes in addition to its text. They are claimed before the data are read, so that a
/// file that cannot be written is known at once.
class AllanFiles {
   public:
    /// Throws InputError where options do not fit each other, or a file cannot be written or is one that is read.
    explicit AllanFiles(const AllanArguments& arguments);

    /// Whether the data of the series must be kept for the outputs that were asked for.
    bool need_data() const { return !densities_.empty() || !maps_.empty(); }

    /// Writes all of them. Throws InputError or RunError; each file is complete or not there.
    void write(const AllanRequest& request, const std::vector<AnalysedSeries>& series) const;

   private:
    using Claimed = std::unique_ptr<AtomicPath>;
    void write_densities(const AllanRequest& request, const std::vector<AnalysedSeries>& series,
                         const std::vector<AllanOutput>& outputs) const;
    void write_maps(const AllanRequest& request, const std::vector<AnalysedSeries>& series,
                    const std::vector<AllanOutput>& outputs) const;

    Claimed figure_;
    Claimed table_;
    std::vector<Claimed> densities_;
    DensityChoice density_choice_;
    std::vector<Claimed> maps_;
    std::string window_;
    std::vector<std::pair<ExportFormat, Claimed>> exports_;
};

}  // namespace ringlock::app

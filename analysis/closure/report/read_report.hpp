#pragma once
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/report/predictive.hpp"

namespace ringlock::closure {

/// A report of the closed loop as it was written into a folder or printed with --json.
struct Report {
    std::string source;  ///< name of the record; empty where only the JSON is there
    /// Without `base_alone`, `disturbed` and the other members that closure.json lacks. `residual` and the
    /// steps of `predictive` are those of closure.h5. The text of the structure that is left stands in
    /// `unexplained_text`.
    Closure closure;
    std::string unexplained_text;
    Predictive predictive;
    std::vector<std::string> placeholders;  ///< keys of closed.toml that the record does not determine
    std::vector<std::string> not_held;      ///< findings that closed.toml does not hold
};

/// The report of one record from the object that --json prints. Throws InputError, which does not know the file, where
/// something is missing, of another type, or the name of an effect that this program does not have.
Report report_of(const nlohmann::json& object);

/// The report that `ringlock closure -o` has written into a folder: closure.json and closure.h5. Throws InputError
/// where one of them is missing or damaged.
Report read_report(const std::filesystem::path& folder);

/// The verdict in one sentence, as verdict_sentence() of the loop's result.
std::string verdict_sentence(const Report& report);

}  // namespace ringlock::closure

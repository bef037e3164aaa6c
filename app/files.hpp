#pragma once
#include <filesystem>
#include <string>
#include <vector>

/// The files that a command line names.
namespace ringlock::app {

/// A file of the command line.
struct NamedFile {
    enum class Use { input, output };

    std::string argument;  ///< the argument that names it, as in "--plot"
    std::filesystem::path path;
    Use use;
};

/// Refuses a command that would write over its own input, or over a file that it has written itself: an output must be
/// another file than every input and every other output, under any name, symbolic link or hard link. Empty paths, and
/// "-" as input, are no files. Throws InputError.
void refuse_same_files(const std::vector<NamedFile>& files);

}  // namespace ringlock::app

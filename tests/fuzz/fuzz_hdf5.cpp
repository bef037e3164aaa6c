// HDF5 files with damaged bytes for the readers of series, records and results: `fuzz_hdf5 SEED COUNT [FIRST]`.
//
// The guard is away, so that thousands of files are read in one process: what the library does to such a process is
// counted and no fault, because in the program the trial ends of it. What is searched for are faults in the code of
// this repository, on whatever the library returns for a damaged file.
#include <string>
#include <vector>

#include "analysis/record/record.hpp"
#include "analysis/record/series/series.hpp"
#include "analysis/study/result/result_file.hpp"
#include "engine/core/error.hpp"
#include "tests/fuzz/fuzz.hpp"
#include "tests/fuzz/hdf5_files.hpp"

namespace {

using namespace ringlock;

void read_as(const fuzz::Hdf5File& kind, fuzz::Chance& chance, const std::string& path, fuzz::Tally& tally) {
    const auto attempt = [&](auto read) { fuzz::attempt(path, read, tally); };
    if (kind.is_result) {
        attempt([&] {
            const study::Experiment experiment = study::read_result(path);
            try {
                static_cast<void>(study::summarise(experiment));
            } catch (const InputError&) {
                return;  // the command knows which file the values are of
            }
        });
        attempt([&] { static_cast<void>(study::read_provenance(path)); });
    } else if (kind.columns.empty()) {
        attempt([&] { static_cast<void>(record::hdf5_format(path)); });
        attempt([&] { static_cast<void>(record::read_record(path)); });
    } else {
        record::SeriesRequest request;
        request.path = path;
        if (!chance.one_in(6)) request.column = chance.of(kind.columns);
        if (chance.one_in(4)) {
            request.time = chance.of(kind.columns);
            request.rate_hz = 100.0;
        }
        attempt([&] { record::read_series(request); });
    }
}

}  // namespace

int main(int argc, char** argv) {
    const std::vector<fuzz::Hdf5File> kinds = fuzz::hdf5_files();
    const auto one = [&](fuzz::Chance& chance, fuzz::InputFile& file, fuzz::Tally& tally) {
        const fuzz::Hdf5File& kind = chance.of(kinds);
        file.write(fuzz::damaged(kind.bytes, chance.one_in(20) ? 0 : 1 + chance.any(3), chance));
        read_as(kind, chance, file.path(), tally);
    };
    return fuzz::run({"fuzz_hdf5", one, {"libhdf5", "libz.so", "libsz.so", "libaec.so"}}, {argv + 1, argv + argc});
}

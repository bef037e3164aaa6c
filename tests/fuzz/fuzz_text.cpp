// Damaged texts for the readers of series and records: `fuzz_text SEED COUNT [FIRST]`.
#include <string>

#include "tests/fuzz/fuzz.hpp"
#include "tests/fuzz/texts.hpp"

int main(int argc, char** argv) {
    using namespace ringlock::fuzz;
    const auto one = [](Chance& chance, InputFile& file, Tally& tally) {
        file.write(damaged_text(chance.of(logs), chance.any(5), chance));
        read_text(file, chance, tally);
    };
    return run({"fuzz_text", one}, {argv + 1, argv + argc});
}

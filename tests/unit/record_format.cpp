// What a record holds, against the page that describes it.
#include <gtest/gtest.h>

#include "analysis/record/record.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/unit/format_page.hpp"
#include "tests/unit/record_support.hpp"

namespace ringlock::record {
namespace record_format_test {
namespace {

TEST(RecordFormat, HoldsWhatThePageSays) {
    const test::TemporaryDirectory directory;
    test::Entries file;
    for (const SampleKind kind :
         {SampleKind::angle_increment_arcsec, SampleKind::angle_arcsec, SampleKind::quarter_count}) {
        Record record = test::full_record();
        const auto witnesses = record.samples->witnesses;
        record.samples = test::plain_samples(40, kind);
        record.samples->witnesses = witnesses;
        write_record((directory / "r.h5").string(), record);
        file.merge(test::walk(directory / "r.h5", {{50, "turns"}, {40, "samples"}, {3, "rows"}, {2, "points"}}));
    }
    test::compare(test::page(RINGLOCK_SOURCE_DIR "/docs/record.md", {}), file);
}

}  // namespace
}  // namespace record_format_test
}  // namespace ringlock::record

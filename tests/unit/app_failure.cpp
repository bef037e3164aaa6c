#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <new>
#include <stdexcept>
#include <string>
#include <system_error>

#include "app/failure.hpp"
#include "engine/core/error.hpp"

namespace ringlock::app {
namespace app_failure_test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

/// The message of the error that comes of the work; its class must be that.
template <class Error>
std::string message_of(const std::function<void()>& work) {
    try {
        name_file_of_failure("log\x1b.h5", work);
    } catch (const Error& error) {
        return error.what();
    }
    return "no error";
}

TEST(NameFileOfFailure, WhatDoesNotKnowTheFileNamesItAfterwards) {
    EXPECT_THAT(message_of<InputError>([] { throw std::domain_error("beyond a double"); }),
                AllOf(StartsWith("log\\x1b.h5: "), HasSubstr("beyond a double")));
    EXPECT_THAT(message_of<RunError>([] { throw std::bad_alloc(); }),
                AllOf(StartsWith("log\\x1b.h5: "), HasSubstr("out of memory")));
    EXPECT_THAT(message_of<RunError>([] {
                    throw std::filesystem::filesystem_error("cannot rename",
                                                            std::make_error_code(std::errc::permission_denied));
                }),
                AllOf(StartsWith("log\\x1b.h5: "), HasSubstr("cannot rename")));
}

TEST(NameFileOfFailure, WhatNamesItsFileStaysAsItIs) {
    EXPECT_EQ(message_of<InputError>([] { throw InputError("other.h5: is wrong"); }), "other.h5: is wrong");
    EXPECT_EQ(message_of<RunError>([] { throw RunError("other.h5: cannot be written"); }),
              "other.h5: cannot be written");
    EXPECT_EQ(message_of<RunError>([] {}), "no error");
}

TEST(NameFileOfValues, AnErrorOfTheEvaluationNamesTheFileOnce) {
    const auto message = [](const std::string& thrown) -> std::string {
        try {
            name_file_of_values("out.h5", [&] { throw InputError(thrown); });
        } catch (const InputError& error) {
            return error.what();
        }
        return "no error";
    };
    EXPECT_EQ(message("value inf: must be finite"), "out.h5: value inf: must be finite");
    EXPECT_EQ(message("out.h5: is damaged"), "out.h5: is damaged");
}

}  // namespace
}  // namespace app_failure_test
}  // namespace ringlock::app

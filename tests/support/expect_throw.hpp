#pragma once
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace ringlock::test {

/// Runs `action`, expects an exception of type E and returns its message.
template <class E, class Action>
std::string message_of(Action action) {
    try {
        action();
    } catch (const E& error) {
        return error.what();
    } catch (const std::exception& other) {
        ADD_FAILURE() << "another exception: " << other.what();
        return "";
    }
    ADD_FAILURE() << "no exception";
    return "";
}

}  // namespace ringlock::test

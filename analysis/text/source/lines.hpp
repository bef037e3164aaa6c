#pragma once
#include <cstddef>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/text/source/source.hpp"

namespace ringlock::text {

/// Lines of a text, ended by LF, CR LF or, where the first bytes have no LF, by CR.
class Lines {
   public:
    /// `name` is the name of the text in messages.
    Lines(std::unique_ptr<Source> from, std::string name);

    /// The next line without its end, which stays until the next call; false behind the last. Throws InputError where
    /// the bytes are no text (a zero byte, a line longer than 4 MiB) or cannot be read.
    bool next(std::string_view& line);

    /// Number of the last line returned, from 1.
    std::size_t number() const { return number_; }

   private:
    bool refill();
    void make_room();
    void refuse_zeros(std::size_t from, std::size_t count);

    std::unique_ptr<Source> from_;
    std::string name_;
    std::vector<char> buffer_;
    std::size_t begin_ = 0;   ///< of the bytes that have not been returned
    std::size_t filled_ = 0;  ///< end of the bytes that have been read
    std::size_t number_ = 0;
    std::size_t read_ = 0;  ///< bytes that the source has given
    char end_of_line_ = '\n';
    bool at_end_ = false;
};

}  // namespace ringlock::text

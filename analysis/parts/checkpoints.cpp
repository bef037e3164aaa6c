#include "analysis/parts/checkpoints.hpp"

#include <fcntl.h>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <stdio.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <ctime>
#include <iterator>
#include <limits>
#include <system_error>
#include <utility>

#include "analysis/parts/block_record.hpp"
#include "analysis/parts/shard.hpp"
#include "analysis/parts/status.hpp"
#include "engine/core/error.hpp"
#include "engine/core/interrupt.hpp"
#include "engine/core/printable.hpp"
#include "engine/core/system_text.hpp"

namespace ringlock::parts {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

namespace {

constexpr auto longest_without_status = 5s;
constexpr auto between_tries = 1s;
constexpr auto between_complaints = 60s;
constexpr auto longest_without_folder = 10s;

std::string now_utc() { return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr))); }

/// Whether an operation that the system refused may succeed later: when somebody makes room, or a server comes back.
bool may_pass(int error) {
    constexpr int passing[] = {ENOSPC, EDQUOT, EIO, ENOENT, ESTALE, ETIMEDOUT, EAGAIN, EBUSY, ENOMEM, ENFILE, EMFILE};
    return std::find(std::begin(passing), std::end(passing), error) != std::end(passing);
}

/// Brings a file or folder to the disk; 0 or errno.
int sync(const fs::path& path, int flags) {
    const int fd = open(path.c_str(), flags | O_CLOEXEC | O_NOFOLLOW);
    if (fd < 0) return errno;
    const int error = fsync(fd) == 0 ? 0 : errno;
    close(fd);
    return error;
}

std::vector<std::int64_t> gyros_of(const study::Experiment& plan) {
    std::vector<std::int64_t> gyros;
    for (const study::Study& point : plan.points) gyros.push_back(static_cast<std::int64_t>(point.gyros.size()));
    return gyros;
}

}  // namespace

/// One block while it is simulated. Samples go to a file at once, so that memory does not grow with the record.
class Checkpoints::Keeper final : public study::BlockKeeper {
   public:
    explicit Keeper(Checkpoints& home) : home_(home) {
        if (!home_.samples_) return;
        file_ = home_.next_file();
        partial_ = file_.string() + std::string(partial_suffix);
        begin();
    }
    ~Keeper() override {
        if (!partial_.empty() && !finished_) unlink(partial_.c_str());
    }

    bool wants_samples() const override { return writer_ != nullptr; }
    void samples(const study::SampledAngles& samples) override { writer_->add(samples_record, pack(samples)); }

    void finish(const study::FinishedBlock& block) override {
        Waiting waiting{block, static_cast<std::int64_t>(block.gyros.size()), partial_, file_};
        if (writer_) {
            writer_->add(block_record, pack(block));
            add_spent(*writer_, home_.wall_s());
            writer_->close();
            waiting.block.gyros.clear();
            waiting.block.arms.clear();
        }
        finished_ = true;
        home_.take(std::move(waiting), std::chrono::duration<double>(Clock::now() - start_).count());
    }

   private:
    void begin() {
        writer_ = std::make_unique<store::PartWriter>(
            partial_, store::PartWriter::Open::new_file,
            [this](const std::string& problem, int error) { home_.wait_out(problem, error); });
        add(*writer_, home_.manifest_);
    }

    Checkpoints& home_;
    Clock::time_point start_ = Clock::now();
    fs::path file_;
    fs::path partial_;
    std::unique_ptr<store::PartWriter> writer_;
    bool finished_ = false;
};

Checkpoints::Checkpoints(const Folder& folder, const study::Experiment& plan, Options options, Tell tell)
    : path_(folder.path()),
      who_(folder.who()),
      manifest_(folder.manifest()),
      options_(std::move(options)),
      tell_(std::move(tell)),
      samples_(plan.scenario.output.angle_record),
      gyros_of_points_(gyros_of(plan)),
      finished_(manifest_) {
    for (const fs::path& file : folder.files()) {
        try {
            finished_.add_file(file);
        } catch (const InputError& error) {
            const fs::path aside = file.string() + ".damaged";
            tell_(fmt::format("{}; it is put aside as {}, and its gyros are simulated again", error.what(),
                              printable(aside.filename())));
            fs::rename(file, aside);
        }
    }
    seconds_before_ = finished_.wall_s();
    gyros_before_ = gyros_ = finished_.gyros();
}

Checkpoints::Checkpoints(const fs::path& folder, const Manifest& manifest, const Member& member,
                         const study::Experiment& plan, Options options, Tell tell)
    : path_(folder),
      prefix_(fmt::format("rank-{}-", member.rank())),
      manifest_(manifest),
      options_(std::move(options)),
      tell_(std::move(tell)),
      samples_(plan.scenario.output.angle_record),
      gyros_of_points_(gyros_of(plan)),
      finished_(manifest_) {}

void Checkpoints::begin(std::function<ensemble::Progress::Pace()> pace) {
    pace_ = std::move(pace);
    worker_ = std::jthread([this](const std::stop_token& stop) { work(stop); });
}

void Checkpoints::end() noexcept {
    patient_ = false;
    worker_.request_stop();
    if (worker_.joinable()) worker_.join();
}

Checkpoints::~Checkpoints() {
    end();
    for (const Waiting& block : waiting_) {
        if (!block.partial.empty()) unlink(block.partial.c_str());
    }
}

std::vector<study::Stretch> Checkpoints::take_up(std::span<study::Study> points, std::int64_t first,
                                                 std::int64_t last) {
    const std::vector<study::Stretch> gaps = of_shard(finished_.take_up(points, first, last));
    if (options_.leader) {
        options_.leader->give({to_json(manifest_), static_cast<std::int64_t>(points.front().gyros.size()), gaps});
    }
    return gaps;
}

void Checkpoints::collect(std::span<study::Study> points, std::int64_t first, std::int64_t last) {
    if (!options_.leader) return;
    keep_all();
    const std::vector<fs::path> files = options_.leader->wait_for_reports();
    {
        const std::lock_guard one(keeping_);
        const std::lock_guard lock(mutex_);
        const std::vector<fs::path> known = finished_.files();
        for (const fs::path& file : files) {
            if (!std::binary_search(known.begin(), known.end(), file)) finished_.add_file(file);
        }
    }
    const std::vector<study::Stretch> gaps = of_shard(finished_.take_up(points, first, last));
    if (gaps.empty()) return;
    throw RunError(
        fmt::format("{}: {} gyros from gyro {} on were simulated by another process, "
                    "but no file that it reported holds them",
                    printable(path_), gaps.front().last - gaps.front().first, gaps.front().first));
}

std::vector<study::Stretch> Checkpoints::to_do() const {
    return of_shard(finished_.gaps(gyros_of_points_, 0, std::numeric_limits<std::int64_t>::max()));
}

std::vector<study::Stretch> Checkpoints::of_shard(std::vector<study::Stretch> gaps) const {
    return options_.shard ? within(gaps, gyros_of_points_, *options_.shard) : gaps;
}

std::unique_ptr<study::BlockKeeper> Checkpoints::keeper(std::size_t, std::int64_t, std::size_t) {
    return std::make_unique<Keeper>(*this);
}

std::int64_t Checkpoints::gyros() const {
    const std::lock_guard lock(mutex_);
    return gyros_;
}

std::optional<double> Checkpoints::mean_block_s() const {
    const std::lock_guard lock(mutex_);
    if (blocks_ == 0) return std::nullopt;
    return blocks_s_ / static_cast<double>(blocks_);
}

void Checkpoints::take(Waiting waiting, double block_s) {
    {
        const std::lock_guard lock(mutex_);
        ++blocks_;
        blocks_s_ += block_s;
        gyros_ += waiting.gyros;
        const std::string point =
            gyros_of_points_.size() > 1 ? fmt::format("point {}, ", waiting.block.study + 1) : std::string();
        last_block_ = fmt::format("{}gyros {} to {} at {}", point, waiting.block.first_gyro,
                                  waiting.block.first_gyro + waiting.gyros - 1, now_utc());
        waiting_.push_back(std::move(waiting));
    }
    if (options_.every_s == 0.0) keep_all();
}

bool Checkpoints::keep_what_can_be() noexcept try {
    end();
    const HoldEnd until_it_is_kept;
    keep_all();
    return true;
} catch (...) {
    return false;
}

void Checkpoints::keep_all() {
    const std::lock_guard one(keeping_);
    std::vector<Waiting> blocks;
    {
        const std::lock_guard lock(mutex_);
        blocks.swap(waiting_);
    }
    if (blocks.empty()) return;
    try {
        keep_blocks(blocks);
    } catch (...) {
        const std::lock_guard lock(mutex_);
        waiting_.insert(waiting_.end(), std::make_move_iterator(blocks.begin()), std::make_move_iterator(blocks.end()));
        throw;
    }
}

/// Blocks that are kept leave the list.
void Checkpoints::keep_blocks(std::vector<Waiting>& blocks) {
    const auto note = [&](const Waiting& block, const fs::path& file) {
        const std::lock_guard lock(mutex_);
        if (finished_.blocks() == 0) note_written(path_);
        finished_.add_block(block.block.study, block.block.first_gyro, block.gyros, file, true);
    };
    while (!blocks.empty() && !blocks.back().partial.empty()) {
        settle(blocks.back().partial, blocks.back().file);
        note(blocks.back(), blocks.back().file);
        blocks.pop_back();
    }
    if (blocks.empty()) return;
    const fs::path file = next_file();
    const fs::path partial = file.string() + std::string(partial_suffix);
    try {
        store::PartWriter writer(partial, store::PartWriter::Open::new_file,
                                 [this](const std::string& problem, int code) { wait_out(problem, code); });
        add(writer, manifest_);
        for (const Waiting& block : blocks) writer.add(block_record, pack(block.block));
        add_spent(writer, wall_s());
        writer.close();
        settle(partial, file);
    } catch (...) {
        unlink(partial.c_str());
        throw;
    }
    for (const Waiting& block : blocks) note(block, file);
    blocks.clear();
}

/// Brings a complete file to the disk and gives it its name, which is free.
void Checkpoints::settle(const fs::path& partial, const fs::path& file) {
    while (const int error = sync(partial, O_RDONLY)) {
        wait_out(fmt::format("{}: cannot be brought to the disk: {}", printable(partial), system_text(error)), error);
        // The system may regard the data that it could not write as written from now on: only a copy is sure to be
        // written.
        const fs::path copy = partial.string() + std::string(partial_suffix);
        try {
            fs::remove(copy);
            store::PartWriter writer(copy, store::PartWriter::Open::new_file,
                                     [this](const std::string& problem, int code) { wait_out(problem, code); });
            store::read_part(partial, [&](store::RecordKind kind, std::span<const std::byte> content) {
                writer.add(kind, content);
                return true;
            });
            writer.close();
            fs::rename(copy, partial);
        } catch (const InputError& damage) {
            throw RunError(fmt::format("{}; the gyros in it are lost, all others are kept", damage.what()));
        }
    }
    while (std::rename(partial.c_str(), file.c_str()) != 0) {
        const int error = errno;
        wait_out(fmt::format("{}: cannot be named: {}", printable(file), system_text(error)), error);
    }
    // Some file systems cannot sync a folder; the name is in force all the same.
    sync(path_, O_RDONLY | O_DIRECTORY);
}

fs::path Checkpoints::next_file() {
    const std::lock_guard lock(mutex_);
    fs::path file;
    do {
        file = path_ / fmt::format("{}{:06}{}", prefix_, ++numbers_, part_suffix);
    } while (fs::exists(file));
    return file;
}

double Checkpoints::wall_s() const {
    return seconds_before_ + std::chrono::duration<double>(Clock::now() - start_).count();
}

void Checkpoints::wait_out(const std::string& problem, int error) {
    if (!patient_ || !may_pass(error)) throw RunError(problem);
    const auto now = Clock::now();
    bool tells = false;
    {
        const std::lock_guard lock(mutex_);
        if (fs::exists(path_)) {
            gone_.reset();
        } else if (!gone_) {
            gone_ = now;
        } else if (now - *gone_ > longest_without_folder) {
            throw RunError(fmt::format("{}: the folder is gone", printable(path_)));
        }
        if (!reported_ || now - *reported_ > between_complaints) {
            reported_ = now;
            tells = true;
        }
    }
    if (tells) {
        tell_(fmt::format("{}; the run waits for it and tries again every second; finished gyros stay in memory",
                          problem));
    }
    for (const auto until = now + between_tries; Clock::now() < until; std::this_thread::sleep_for(20ms)) {
        check_interrupt();
        if (!patient_) throw RunError(problem);
    }
}

void Checkpoints::work(const std::stop_token& stop) {
    const auto every = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(options_.every_s));
    auto kept = Clock::now();
    auto shown = Clock::time_point::min();
    while (!stop.stop_requested()) {
        try {
            if (Clock::now() - kept >= every) {
                keep_all();
                kept = Clock::now();
            }
        } catch (const std::exception&) {
            // Interrupted, or asked to end: the code that ends the run keeps the finished blocks as far as possible.
        }
        if (pace_ && (shown == Clock::time_point::min() || Clock::now() - shown >= longest_without_status)) {
            tell_status();
            shown = Clock::now();
        }
        std::unique_lock lock(mutex_);
        const auto pause = std::min<Clock::duration>(longest_without_status, std::max<Clock::duration>(every, 100ms));
        wake_.wait_for(lock, stop, pause, [] { return false; });
    }
}

void Checkpoints::tell_status() {
    Status status;
    status.process = who_;
    status.time_utc = now_utc();
    status.elapsed_s = std::chrono::duration<double>(Clock::now() - start_).count();
    status.of_gyros = options_.of_gyros;
    const ensemble::Progress::Pace pace = pace_();
    status.turns_per_s = pace.turns_per_s;
    status.left_s = pace.left_s;
    {
        const std::lock_guard lock(mutex_);
        status.gyros = options_.leader ? gyros_before_ + pace.gyros : gyros_;
        status.last_block = last_block_;
    }
    write_status(path_, status);
}

}  // namespace ringlock::parts

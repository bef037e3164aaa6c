#include <fmt/format.h>
#include <mpi.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <deque>
#include <exception>
#include <filesystem>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "analysis/parts/archive.hpp"
#include "app/failure.hpp"
#include "app/run/ranks.hpp"
#include "engine/core/error.hpp"
#include "engine/core/interrupt.hpp"

/// One thread of each process, that of main(), makes all calls of MPI; the simulation runs in others, which post their
/// requests to it. So MPI_THREAD_FUNNELED is enough, and the leader answers the members' requests for blocks while it
/// simulates: without hardware for it, a one-sided operation waits until its target calls MPI.
namespace ringlock::app {

namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using Bytes = std::vector<std::byte>;

constexpr int leader_rank = 0;
/// Sleep of the thread that makes calls of MPI where there is nothing to do. Each waking takes a core from the
/// simulation for some ten microseconds; a request for blocks, of which a run has some dozens, waits as long at most.
constexpr auto pause = 10ms;

/// Kind of a message.
enum Tag : int { order_tag = 1, end_tag, events_tag, report_tag };

struct Message {
    int from = 0;
    int tag = 0;
    Bytes content;
};

/// All calls of MPI. Used by one thread.
class World {
   public:
    World() {
        int provided = 0;
        MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &provided);
        if (provided < MPI_THREAD_FUNNELED) throw RunError("this MPI cannot be used by a process with several threads");
        MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
        MPI_Comm_size(MPI_COMM_WORLD, &size_);
        MPI_Comm machine = MPI_COMM_NULL;
        MPI_Comm_split_type(MPI_COMM_WORLD, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &machine);
        MPI_Comm_size(machine, &of_this_machine_);
        MPI_Comm_free(&machine);
        const MPI_Aint bytes = rank_ == leader_rank ? sizeof(std::int64_t) : 0;
        MPI_Win_allocate(bytes, sizeof(std::int64_t), MPI_INFO_NULL, MPI_COMM_WORLD, &counter_, &window_);
        if (rank_ == leader_rank) set_counter(0);
        MPI_Barrier(MPI_COMM_WORLD);
    }
    ~World() {
        MPI_Win_free(&window_);
        MPI_Finalize();
    }
    World(const World&) = delete;
    World& operator=(const World&) = delete;

    int rank() const { return rank_; }
    int size() const { return size_; }
    int of_this_machine() const { return of_this_machine_; }

    /// Sets the leader's counter; in the leader, while no member counts.
    void set_counter(std::int64_t value) {
        MPI_Win_lock(MPI_LOCK_EXCLUSIVE, leader_rank, 0, window_);
        *counter_ = value;
        MPI_Win_unlock(leader_rank, window_);
    }
    /// Adds one to the leader's counter and returns the previous value.
    std::int64_t count() {
        const std::int64_t one = 1;
        std::int64_t before = 0;
        MPI_Win_lock(MPI_LOCK_SHARED, leader_rank, 0, window_);
        MPI_Fetch_and_op(&one, &before, MPI_INT64_T, leader_rank, 0, MPI_SUM, window_);
        MPI_Win_unlock(leader_rank, window_);
        return before;
    }
    void send(int to, Tag tag, std::span<const std::byte> content) {
        MPI_Send(content.data(), static_cast<int>(content.size()), MPI_BYTE, to, tag, MPI_COMM_WORLD);
    }
    /// A message that has come; makes progress for the operations of others either way.
    std::optional<Message> receive() {
        int is_there = 0;
        MPI_Status status;
        MPI_Iprobe(MPI_ANY_SOURCE, MPI_ANY_TAG, MPI_COMM_WORLD, &is_there, &status);
        if (!is_there) return std::nullopt;
        int size = 0;
        MPI_Get_count(&status, MPI_BYTE, &size);
        Message message{status.MPI_SOURCE, status.MPI_TAG, Bytes(static_cast<std::size_t>(size))};
        MPI_Recv(message.content.data(), size, MPI_BYTE, message.from, message.tag, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
        return message;
    }
    [[noreturn]] void abort(int status) {
        MPI_Abort(MPI_COMM_WORLD, status);
        std::_Exit(status);
    }

   private:
    int rank_ = 0;
    int size_ = 1;
    int of_this_machine_ = 1;
    std::int64_t* counter_ = nullptr;
    MPI_Win window_ = MPI_WIN_NULL;
};

/// Serves the threads that simulate: the thread that calls serve() performs the calls that they post.
class Service {
   public:
    explicit Service(World& world) : world_(world) {}
    virtual ~Service() = default;
    Service(const Service&) = delete;
    Service& operator=(const Service&) = delete;

    /// Until stop(); `pause` is how long it sleeps where there is nothing to do.
    void serve(Clock::duration pause) {
        std::unique_lock lock(mutex_);
        while (!stopped_ || !posted_.empty()) {
            while (!posted_.empty()) {
                const std::shared_ptr<std::packaged_task<std::int64_t()>> task = posted_.front();
                posted_.pop_front();
                lock.unlock();
                (*task)();
                lock.lock();
            }
            lock.unlock();
            while (const std::optional<Message> message = world_.receive()) take(*message);
            in_passing();
            lock.lock();
            if (posted_.empty() && !stopped_) wake_.wait_for(lock, pause);
        }
    }
    void stop() {
        const std::lock_guard lock(mutex_);
        stopped_ = true;
        wake_.notify_all();
    }

   protected:
    /// A message, in the thread that serves.
    virtual void take(const Message& message) = 0;
    /// Periodic work of the thread that serves, called between messages.
    virtual void in_passing() {}

    World& world() { return world_; }

    /// Has the thread that serves do something, and waits for it. Throws Interrupted.
    std::int64_t post(std::function<std::int64_t()> work) {
        auto task = std::make_shared<std::packaged_task<std::int64_t()>>(std::move(work));
        std::future<std::int64_t> outcome = task->get_future();
        {
            const std::lock_guard lock(mutex_);
            posted_.push_back(std::move(task));
            wake_.notify_all();
        }
        while (outcome.wait_for(20ms) != std::future_status::ready) check_interrupt();
        return outcome.get();
    }

   private:
    World& world_;
    std::mutex mutex_;
    std::condition_variable wake_;
    std::deque<std::shared_ptr<std::packaged_task<std::int64_t()>>> posted_;
    bool stopped_ = false;
};

/// Blocks by a counter that all processes share. A count stands for a chunk of blocks: large ones at first, so that the
/// counter is requested seldom, and single blocks at the end, so that all processes end at the same time.
class SharedBlocks {
   public:
    void begin(std::size_t blocks, int processes) {
        const std::lock_guard lock(mutex_);
        constexpr std::size_t of_rest = 4;
        chunks_.clear();
        for (std::size_t at = 0; at < blocks;) {
            const std::size_t size =
                std::max<std::size_t>(1, (blocks - at) / (of_rest * static_cast<std::size_t>(processes)));
            chunks_.push_back({at, at + size});
            at += size;
        }
        mine_ = {};
    }
    template <class Count>
    std::optional<std::size_t> next(Count&& count) {
        const std::lock_guard lock(mutex_);
        if (mine_.first == mine_.second) {
            const auto chunk = static_cast<std::size_t>(count());
            if (chunk >= chunks_.size()) return std::nullopt;
            mine_ = chunks_[chunk];
        }
        return mine_.first++;
    }

   private:
    std::mutex mutex_;
    std::vector<std::pair<std::size_t, std::size_t>> chunks_;
    std::pair<std::size_t, std::size_t> mine_;
};

/// An event of a block, as numbers in a message: kind, block, and three values that depend on the kind.
struct Event {
    enum Kind : std::int64_t { entered, advanced };
    std::int64_t kind = entered;
    std::int64_t block = 0;
    std::int64_t gyros = 0;  ///< or the stage
    std::int64_t turns = 0;
    std::int64_t tabulated = 0;
};
constexpr std::size_t numbers_of_event = 5;

Bytes pack(const std::vector<Event>& events) {
    std::vector<std::int64_t> numbers;
    for (const Event& event : events) {
        numbers.insert(numbers.end(), {event.kind, event.block, event.gyros, event.turns, event.tabulated});
    }
    parts::Packer archive;
    archive(numbers);
    return archive.take();
}

std::vector<Event> unpack_events(std::span<const std::byte> bytes) {
    parts::Unpacker archive(bytes);
    std::vector<std::int64_t> numbers;
    archive(numbers);
    std::vector<Event> events;
    for (std::size_t i = 0; i + numbers_of_event <= numbers.size(); i += numbers_of_event) {
        events.push_back({numbers[i], numbers[i + 1], numbers[i + 2], numbers[i + 3], numbers[i + 4]});
    }
    return events;
}

/// An order with the threads of all processes.
Bytes pack(const parts::Order& order, std::int64_t threads) {
    std::vector<std::int64_t> numbers;
    for (const study::Stretch& stretch : order.stretches) {
        numbers.insert(numbers.end(), {static_cast<std::int64_t>(stretch.study), stretch.first, stretch.last});
    }
    parts::Packer archive;
    archive(order.manifest);
    archive(order.gyros);
    archive(threads);
    archive(numbers);
    return archive.take();
}

std::pair<parts::Order, std::int64_t> unpack_order(std::span<const std::byte> bytes) {
    parts::Unpacker archive(bytes);
    parts::Order order;
    std::int64_t threads = 0;
    std::vector<std::int64_t> numbers;
    archive(order.manifest);
    archive(order.gyros);
    archive(threads);
    archive(numbers);
    for (std::size_t i = 0; i + 3 <= numbers.size(); i += 3) {
        order.stretches.push_back({static_cast<std::size_t>(numbers[i]), numbers[i + 1], numbers[i + 2]});
    }
    return {order, threads};
}

class MpiLeader final : public parts::Leader, public Service {
   public:
    explicit MpiLeader(World& world) : Service(world), processes_(world.size()) {}

    int members() const override { return processes_ - 1; }
    void use(int threads) override { threads_ = threads; }
    int threads() const override { return processes_ * threads_; }

    void give(const parts::Order& order) override {
        const Bytes bytes = pack(order, threads());
        post([&, bytes] {
            world().set_counter(0);
            for (int rank = 1; rank < processes_; ++rank) world().send(rank, order_tag, bytes);
            const std::lock_guard lock(mutex_);
            waiting_for_ = processes_ - 1;
            files_.clear();
            return 0;
        });
    }

    void begin(std::size_t blocks) override {
        blocks_.begin(blocks, processes_);
        const std::lock_guard lock(mutex_);
        begun_ = true;
        pass_on();
    }
    std::optional<std::size_t> next() override {
        return blocks_.next([this] { return post([this] { return world().count(); }); });
    }

    std::vector<std::filesystem::path> wait_for_reports() override {
        std::unique_lock lock(mutex_);
        while (waiting_for_ > 0) {
            reported_.wait_for(lock, 20ms);
            check_interrupt();
        }
        begun_ = false;
        events_.clear();
        return files_;
    }

    void tell(ensemble::Observer* observer) override {
        const std::lock_guard lock(mutex_);
        observer_ = observer;
    }

    /// Whether members wait for an order.
    bool members_wait() {
        const std::lock_guard lock(mutex_);
        return waiting_for_ == 0;
    }
    /// Ends the members, which wait for an order. By the thread that serves.
    void end_members(int status) {
        parts::Packer archive;
        archive(static_cast<std::int64_t>(status));
        for (int rank = 1; rank < processes_; ++rank) world().send(rank, end_tag, archive.bytes());
    }

   private:
    void take(const Message& message) override {
        const std::lock_guard lock(mutex_);
        if (message.tag == events_tag) {
            const std::vector<Event> more = unpack_events(message.content);
            events_.insert(events_.end(), more.begin(), more.end());
            if (begun_) pass_on();
        } else if (message.tag == report_tag) {
            parts::Unpacker archive(message.content);
            std::vector<std::string> files;
            archive(files);
            files_.insert(files_.end(), files.begin(), files.end());
            --waiting_for_;
            reported_.notify_all();
        }
    }

    void pass_on() {
        for (const Event& event : events_) {
            if (!observer_) break;
            const auto block = static_cast<std::size_t>(event.block);
            if (event.kind == Event::entered) {
                observer_->enter(block, static_cast<ensemble::BlockStage>(event.gyros));
            } else {
                observer_->advance(block, event.gyros, event.turns, event.tabulated != 0);
            }
        }
        events_.clear();
    }

    const int processes_;
    int threads_ = 1;
    SharedBlocks blocks_;
    std::mutex mutex_;  ///< guards the members below
    std::condition_variable reported_;
    int waiting_for_ = 0;
    std::vector<std::filesystem::path> files_;
    ensemble::Observer* observer_ = nullptr;
    std::vector<Event> events_;  ///< that came before the plan they are about
    bool begun_ = false;
};

class MpiMember final : public parts::Member, public Service, private ensemble::Observer {
   public:
    explicit MpiMember(World& world) : Service(world), rank_(world.rank()), processes_(world.size()) {}

    int rank() const override { return rank_; }
    int threads() const override { return threads_; }
    void begin(std::size_t blocks) override { blocks_.begin(blocks, processes_); }
    std::optional<std::size_t> next() override {
        return blocks_.next([this] { return post([this] { return world().count(); }); });
    }

    std::optional<parts::Order> next_order() override {
        std::unique_lock lock(mutex_);
        while (!order_ && !end_) {
            ordered_.wait_for(lock, 20ms);
            check_interrupt();
        }
        if (order_) return *std::exchange(order_, std::nullopt);
        if (*end_ != done) throw EndQuietly{*end_};
        return std::nullopt;
    }
    void report(const std::vector<std::filesystem::path>& files) override {
        std::vector<std::string> names;
        for (const std::filesystem::path& file : files) names.push_back(file.string());
        parts::Packer archive;
        archive(names);
        post([this, bytes = archive.take()] {
            send_events();
            world().send(leader_rank, report_tag, bytes);
            return 0;
        });
    }
    ensemble::Observer& observer() override { return *this; }

    /// Whether the leader has ended the run.
    bool is_over() {
        const std::lock_guard lock(mutex_);
        return end_.has_value();
    }

   private:
    void take(const Message& message) override {
        const std::lock_guard lock(mutex_);
        if (message.tag == order_tag) {
            auto [order, threads] = unpack_order(message.content);
            threads_ = static_cast<int>(threads);
            order_ = std::move(order);
        } else if (message.tag == end_tag) {
            parts::Unpacker archive(message.content);
            std::int64_t status = 0;
            archive(status);
            end_ = static_cast<int>(status);
        }
        ordered_.notify_all();
    }
    void in_passing() override {
        if (Clock::now() - sent_ >= 250ms) send_events();
    }
    void send_events() {
        std::vector<Event> events;
        {
            const std::lock_guard lock(mutex_);
            events.swap(events_);
        }
        sent_ = Clock::now();
        if (!events.empty()) world().send(leader_rank, events_tag, pack(events));
    }

    void stage(const std::string&) override {}
    void plan(std::span<const ensemble::PlannedBlock>, int) override {}
    void enter(std::size_t block, ensemble::BlockStage stage) override {
        const std::lock_guard lock(mutex_);
        events_.push_back({Event::entered, static_cast<std::int64_t>(block), static_cast<std::int64_t>(stage), 0, 0});
    }
    void advance(std::size_t block, std::int64_t gyros, std::int64_t turns, bool tabulated) override {
        const std::lock_guard lock(mutex_);
        const auto number = static_cast<std::int64_t>(block);
        if (!events_.empty() && !tabulated) {
            Event& last = events_.back();
            if (last.kind == Event::advanced && last.block == number && !last.tabulated) {
                last.gyros += gyros;
                last.turns += turns;
                return;
            }
        }
        events_.push_back({Event::advanced, number, gyros, turns, tabulated ? 1 : 0});
    }

    const int rank_;
    const int processes_;
    SharedBlocks blocks_;
    Clock::time_point sent_ = Clock::now();
    std::mutex mutex_;  ///< guards the members below
    std::condition_variable ordered_;
    std::optional<parts::Order> order_;
    std::optional<int> end_;
    int threads_ = 1;
    std::vector<Event> events_;
};

bool started_together() {
    for (const char* name : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMIX_RANK"}) {
        if (std::getenv(name) != nullptr) return true;
    }
    return false;
}

/// Does the work in another thread while this one serves it; returns the exception that the work throws.
std::exception_ptr serve(Service& service, Clock::duration pause, const std::function<void()>& work) {
    std::exception_ptr failure;
    std::thread worker([&] {
        try {
            work();
        } catch (...) {
            failure = std::current_exception();
        }
        service.stop();
    });
    service.serve(pause);
    worker.join();
    return failure;
}

}  // namespace

void with_ranks(const std::function<void(const Ranks&)>& work) {
    if (!started_together()) return work({});
    std::exception_ptr failure;
    {
        World world;
        if (world.size() == 1) {
            work({});
            return;
        }
        Ranks ranks;
        ranks.of_this_machine = world.of_this_machine();
        if (world.rank() == leader_rank) {
            MpiLeader leader(world);
            ranks.leader = &leader;
            failure = serve(leader, pause, [&] { work(ranks); });
            const int status = failure ? tell_failure(failure) : done;
            if (!leader.members_wait()) world.abort(status);
            leader.end_members(status);
            if (failure) failure = std::make_exception_ptr(EndQuietly{status});
        } else {
            MpiMember member(world);
            ranks.member = &member;
            failure = serve(member, pause, [&] { work(ranks); });
            if (failure) {
                const int status = tell_failure(failure);
                if (!member.is_over()) world.abort(status);
                failure = std::make_exception_ptr(EndQuietly{status});
            }
        }
    }
    if (failure) std::rethrow_exception(failure);
}

}  // namespace ringlock::app

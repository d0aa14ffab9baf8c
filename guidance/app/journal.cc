#include "guidance/app/journal.h"

#include <algorithm>
#include <cerrno>
#include <condition_variable>
#include <cstring>
#include <filesystem>
#include <limits>
#include <map>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <unistd.h>

#include "devices/replay/synced_file.h"
#include "guidance/app/journal_files.h"
#include "guidance/journal/mcap_writer.h"
#include "pose/base/check.h"

namespace tbm {
namespace {

namespace fs = std::filesystem;

// Share of all journals that one file may have.
constexpr std::int64_t kFileShare = 8;

std::string_view TextOf(const Bytes& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

// What stands before each message in the queue.
struct EntryHead {
  Timestamp log_time;
  Timestamp publish_time;
  std::uint32_t size = 0;
  std::uint32_t sequence = 0;
  Journal::Channel channel = 0;
};

struct Entry {
  EntryHead head;
  BytesView data;
  std::size_t behind = 0;  // where the next one begins
};

// Messages one behind the other in memory that is taken once.
class Queue {
 public:
  explicit Queue(std::size_t max_bytes) : max_bytes_(max_bytes) { bytes_.reserve(max_bytes); }

  bool HasRoomFor(std::size_t data_bytes) const {
    return data_bytes <= std::numeric_limits<std::uint32_t>::max() &&
           bytes_.size() + sizeof(EntryHead) + data_bytes <= max_bytes_;
  }
  void Add(const EntryHead& head, BytesView data) {
    const BytesView head_bytes = std::as_bytes(std::span(&head, 1));
    bytes_.insert(bytes_.end(), head_bytes.begin(), head_bytes.end());
    bytes_.insert(bytes_.end(), data.begin(), data.end());
  }
  Entry At(std::size_t position) const {
    Entry entry;
    std::memcpy(&entry.head, bytes_.data() + position, sizeof(EntryHead));
    entry.data = BytesView(bytes_).subspan(position + sizeof(EntryHead), entry.head.size);
    entry.behind = position + sizeof(EntryHead) + entry.head.size;
    return entry;
  }
  void Clear() { bytes_.clear(); }
  std::size_t size_bytes() const { return bytes_.size(); }
  bool empty() const { return bytes_.empty(); }

 private:
  std::size_t max_bytes_;
  Bytes bytes_;
};

std::int64_t DayOf(Timestamp time) {
  return std::chrono::floor<std::chrono::days>(Duration(time.ns)).count();
}

}  // namespace

class Journal::Work {
 public:
  explicit Work(JournalOptions options)
      : options_(std::move(options)),
        filling_(options_.queue_max_bytes),
        draining_(options_.queue_max_bytes),
        thread_([this] { Run(); }) {}
  ~Work() { Close(); }

  Channel AddChannel(JournalChannel channel) {
    const std::lock_guard lock(mutex_);
    TBM_CHECK(channels_.size() < std::numeric_limits<Channel>::max());
    channels_.push_back({std::move(channel), 0});
    return static_cast<Channel>(channels_.size() - 1);
  }

  bool Add(Channel channel, BytesView data, Timestamp log_time, Timestamp publish_time) {
    bool is_news = false;
    {
      const std::lock_guard lock(mutex_);
      TBM_CHECK(channel < channels_.size());
      const std::uint32_t sequence = ++channels_[channel].sequence;
      if (is_closing_ || !filling_.HasRoomFor(data.size())) {
        ++status_.messages_dropped;
        return false;
      }
      const std::size_t before = filling_.size_bytes();
      if (before == 0) oldest_added_at_ = std::chrono::steady_clock::now();
      const auto size = static_cast<std::uint32_t>(data.size());
      filling_.Add({log_time, publish_time, size, sequence, channel}, data);
      ++accepted_;
      // The thread has to hear of the first, for its age, and of the one that fills a chunk.
      is_news = before == 0 || (before < options_.chunk_max_bytes &&
                                filling_.size_bytes() >= options_.chunk_max_bytes);
    }
    if (is_news) news_.notify_one();
    return true;
  }

  bool Flush(std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    const std::uint64_t wanted = accepted_;
    is_flush_asked_ = true;
    news_.notify_one();
    return written_.wait_for(lock, timeout, [&] {
      return status_.messages_written >= wanted || is_closed_;
    }) && status_.messages_written >= wanted;
  }

  void Close() {
    {
      const std::lock_guard lock(mutex_);
      is_closing_ = true;
    }
    news_.notify_one();
    if (thread_.joinable()) thread_.join();
  }

  JournalStatus status() const {
    const std::lock_guard lock(mutex_);
    return status_;
  }

 private:
  struct KnownChannel {
    JournalChannel channel;
    std::uint32_t sequence = 0;
  };

  // What is held for a file that is open.
  struct OpenFile {
    explicit OpenFile(std::string_view program) : writer(program) {}
    McapWriter writer;
    SyncedFile file;
    std::string path;
    std::map<Channel, std::uint16_t> mcap_channels;
    Timestamp first_log_time;
    Timestamp newest_log_time;
    bool has_chunk = false;
  };

  void Run() {
    bool is_last = false;
    while (!is_last) {
      is_last = WaitForMessages();
      is_turn_free_ = true;
      if (!Drain() && !is_last) is_last = WaitToTryAgain();
    }
    // What came while the disk was not to be had gets its last chance.
    if (Drain()) TakeOver();
    (void)Drain();
    Finish();
    const std::lock_guard lock(mutex_);
    status_.messages_dropped += accepted_ - status_.messages_written;
    if (status_.state == JournalState::kWriting) status_.state = JournalState::kIdle;
    is_closed_ = true;
    written_.notify_all();
  }

  // True when nothing is left in draining_.
  bool Drain() {
    while (position_ < draining_.size_bytes()) {
      if (!WriteChunk()) return false;
    }
    return true;
  }

  // Until there is a chunk's worth, or the oldest is old enough; takes it over. True at the end.
  bool WaitForMessages() {
    std::unique_lock lock(mutex_);
    if (position_ < draining_.size_bytes()) return is_closing_;  // not done with the last
    const auto is_due = [this] {
      return is_closing_ || filling_.size_bytes() >= options_.chunk_max_bytes ||
             (is_flush_asked_ && !filling_.empty());
    };
    while (!is_due()) {
      if (filling_.empty()) {
        is_flush_asked_ = false;
        news_.wait_for(lock, std::chrono::seconds(10));
        continue;
      }
      const auto age = std::chrono::steady_clock::now() - oldest_added_at_;
      if (age >= options_.chunk_max_age) break;
      news_.wait_for(lock, options_.chunk_max_age - age);
    }
    is_flush_asked_ = false;
    SwapQueues();
    return is_closing_;
  }

  bool WaitToTryAgain() {
    std::unique_lock lock(mutex_);
    return news_.wait_for(lock, options_.retry_after, [this] { return is_closing_; });
  }

  void TakeOver() {
    const std::lock_guard lock(mutex_);
    SwapQueues();
  }

  void SwapQueues() {
    draining_.Clear();
    position_ = 0;
    std::swap(filling_, draining_);
  }

  // One chunk from the front of what is being drained, up to the disk. On a failure it is still
  // there.
  bool WriteChunk() {
    const Entry first = draining_.At(position_);
    std::error_code ignored;
    // A file whose name is gone takes bytes as before, and nobody ever reads them.
    if (open_ && !fs::exists(open_->path, ignored)) open_.reset();
    if (open_ && (IsFull() || EndsBefore(first))) Finish();
    if (!open_ && !Begin(first.head.log_time)) return false;
    if (!LeavesFree(options_.free_min_bytes)) {
      if (open_->has_chunk) Finish();
      return Stop(ENOSPC, options_.folder);
    }

    std::size_t position = position_;
    std::uint64_t messages = 0;
    while (position < draining_.size_bytes()) {
      const Entry entry = draining_.At(position);
      const bool is_whole = messages > 0 && (open_->writer.gathered_bytes() + entry.data.size() >=
                                                 options_.chunk_max_bytes ||
                                             EndsBefore(entry));
      if (is_whole) break;
      Gather(entry);
      position = entry.behind;
      ++messages;
    }
    const Bytes bytes = open_->writer.TakeChunk();
    int failure = open_->file.Append(TextOf(bytes));
    if (failure == 0) failure = open_->file.Sync();
    if (failure != 0) return Stop(failure, open_->path);
    open_->has_chunk = true;
    position_ = position;
    Count(bytes.size(), messages);
    return true;
  }

  void Gather(const Entry& entry) {
    auto known = open_->mcap_channels.find(entry.head.channel);
    if (known == open_->mcap_channels.end()) {
      const std::lock_guard lock(mutex_);
      const JournalChannel& channel = channels_[entry.head.channel].channel;
      const std::uint16_t id =
          open_->writer.AddChannel(channel.topic, channel.message_encoding, channel.schema);
      known = open_->mcap_channels.emplace(entry.head.channel, id).first;
    }
    open_->newest_log_time = std::max(open_->newest_log_time, entry.head.log_time);
    open_->writer.AddMessage(known->second,
                             entry.head.sequence,
                             entry.head.log_time,
                             entry.head.publish_time,
                             entry.data);
  }

  void Count(std::size_t bytes, std::uint64_t messages) {
    bool is_too_much = false;
    {
      const std::lock_guard lock(mutex_);
      status_.bytes_written += bytes;
      status_.total_bytes += static_cast<std::int64_t>(bytes);
      is_too_much = status_.total_bytes > options_.total_max_bytes;
    }
    if (is_too_much) KeepTotal();
    const std::lock_guard lock(mutex_);
    status_.state = JournalState::kWriting;
    status_.what.clear();
    status_.messages_written += messages;
    written_.notify_all();
  }

  // A disk that does not tell is tried.
  bool LeavesFree(std::int64_t least_bytes) const {
    const std::int64_t free_bytes = FreeBytes(options_.folder);
    return free_bytes < 0 || free_bytes >= least_bytes;
  }

  bool IsFull() const {
    return open_->has_chunk && open_->file.size_bytes() >= options_.total_max_bytes / kFileShare;
  }

  // Whether the open file ends before `entry` because of its time. Once in each turn at most: a
  // clock that jumps to and fro does not make a file of every message.
  bool EndsBefore(const Entry& entry) {
    const Timestamp time = entry.head.log_time;
    const bool ends = time < open_->newest_log_time - kClockSetBack ||
                      time - open_->first_log_time >= options_.file_max_duration ||
                      DayOf(time) != DayOf(open_->first_log_time);
    if (!ends || !is_turn_free_) return false;
    // Asked again for the same entry when it is the first of the next chunk.
    if (open_->writer.gathered_bytes() == 0) is_turn_free_ = false;
    return true;
  }

  bool Begin(Timestamp first_log_time) {
    std::error_code error;
    const bool is_new_folder = fs::create_directories(options_.folder, error);
    if (error) return Stop(error.value(), options_.folder);
    if (is_new_folder) (void)SyncFolder(fs::absolute(options_.folder, error).parent_path());
    const bool was_full = status().state == JournalState::kDiskFull;
    if (!LeavesFree(options_.free_min_bytes * (was_full ? 2 : 1))) {
      return Stop(ENOSPC, options_.folder);
    }

    const std::vector<JournalFile> files = JournalFilesIn(options_.folder);
    std::uint64_t number = files.empty() ? 1 : files.back().number + 1;
    auto file = std::make_unique<OpenFile>(options_.program);
    int failure = EEXIST;
    // A name can only be taken by a second writer in the same folder.
    for (int attempt = 0; failure == EEXIST && attempt < 100; ++attempt, ++number) {
      const std::string name = JournalFileName(first_log_time, number);
      file->path = (fs::path(options_.folder) / name).string();
      failure = file->file.Create(file->path);
    }
    if (failure != 0) return Stop(failure, file->path);
    file->first_log_time = first_log_time;
    file->newest_log_time = first_log_time;
    const Bytes bytes = file->writer.Begin();
    failure = file->file.Append(TextOf(bytes));
    if (failure == 0) failure = SyncFolder(options_.folder);
    open_ = std::move(file);
    if (failure != 0) return Stop(failure, open_->path);

    std::int64_t total_bytes = static_cast<std::int64_t>(bytes.size());
    for (const JournalFile& old : files) total_bytes += old.bytes;
    const std::lock_guard lock(mutex_);
    status_.file = open_->path;
    status_.bytes_written += bytes.size();
    status_.total_bytes = total_bytes;
    ++status_.files_begun;
    return true;
  }

  // Oldest files first, never the open one.
  void KeepTotal() {
    std::int64_t total_bytes = 0;
    std::uint64_t deleted = 0;
    const std::vector<JournalFile> files = JournalFilesIn(options_.folder);
    for (const JournalFile& file : files) total_bytes += file.bytes;
    for (const JournalFile& file : files) {
      if (total_bytes <= options_.total_max_bytes) break;
      if (open_ && file.path == open_->path) continue;
      std::error_code error;
      if (!fs::remove(file.path, error) || error) continue;
      total_bytes -= file.bytes;
      ++deleted;
    }
    const std::lock_guard lock(mutex_);
    status_.total_bytes = total_bytes;
    status_.files_deleted += deleted;
  }

  // Summary and footer; the file can be read without them.
  void Finish() {
    if (!open_) return;
    const Bytes bytes = open_->writer.End();
    if (open_->file.Append(TextOf(bytes)) == 0) {
      (void)open_->file.Sync();
      const std::lock_guard lock(mutex_);
      status_.bytes_written += bytes.size();
      status_.total_bytes += static_cast<std::int64_t>(bytes.size());
    }
    open_.reset();
  }

  bool Stop(int error, std::string path) {  // a copy: it may be that of the file which is closed
    // Else each attempt would leave a file with nothing in it.
    if (open_ && !open_->has_chunk) ::unlink(open_->path.c_str());
    open_.reset();
    const std::lock_guard lock(mutex_);
    status_.state = MeansFull(error) ? JournalState::kDiskFull : JournalState::kFailed;
    status_.what = fmt::format("{}: {}", path, std::strerror(error));
    return false;
  }

  const JournalOptions options_;
  mutable std::mutex mutex_;
  std::condition_variable news_;
  std::condition_variable written_;
  // Below mutex_.
  std::vector<KnownChannel> channels_;
  Queue filling_;
  std::chrono::steady_clock::time_point oldest_added_at_;
  std::uint64_t accepted_ = 0;
  JournalStatus status_;
  bool is_flush_asked_ = false;
  bool is_closing_ = false;
  bool is_closed_ = false;
  // The thread's own.
  Queue draining_;
  std::size_t position_ = 0;  // in draining_: what is before it is on the disk
  std::unique_ptr<OpenFile> open_;
  bool is_turn_free_ = true;

  std::thread thread_;
};

Journal::Journal(JournalOptions options) : work_(std::make_unique<Work>(std::move(options))) {}
Journal::~Journal() = default;
Journal::Channel Journal::AddChannel(JournalChannel channel) {
  return work_->AddChannel(std::move(channel));
}
bool Journal::Add(Channel channel, BytesView data, Timestamp log_time, Timestamp publish_time) {
  return work_->Add(channel, data, log_time, publish_time);
}
bool Journal::Flush(std::chrono::milliseconds timeout) { return work_->Flush(timeout); }
void Journal::Close() { work_->Close(); }
JournalStatus Journal::status() const { return work_->status(); }

}  // namespace tbm

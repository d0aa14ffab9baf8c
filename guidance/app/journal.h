#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "guidance/journal/mcap_format.h"
#include "pose/base/time.h"

namespace tbm {

struct JournalOptions {
  std::string folder;   // made when missing
  std::string program;  // who writes, with its version; stands in each file
  Duration file_max_duration = std::chrono::minutes(30);
  // Of all journal files in the folder together: beyond it the oldest whole file goes. One file
  // stops at an eighth of it, so that never more than that is lost at once.
  std::int64_t total_max_bytes = 20'000'000'000;
  // Left free on the disk for the rest of the machine: below it writing stops, and goes on when
  // twice as much is free. Journals are not deleted to make this room.
  std::int64_t free_min_bytes = 500'000'000;
  // A chunk is closed and brought to the disk at whichever comes first; a message larger than that
  // is a chunk of its own.
  std::size_t chunk_max_bytes = 64 * 1024;
  std::chrono::milliseconds chunk_max_age{1000};
  std::size_t queue_max_bytes = 8 * 1024 * 1024;  // twice this is held in memory
  std::chrono::milliseconds retry_after{2000};    // after a failure
};

// What is written under one name. For DDS topics guidance/app/journal_topic.h fills it in; what no
// other process hears has a name of its own, "local/step".
struct JournalChannel {
  std::string topic;
  std::string message_encoding;
  McapSchema schema;
};

enum class JournalState {
  kIdle,      // nothing to write yet, or closed
  kWriting,   // the last chunk is on the disk
  kDiskFull,  // goes on by itself when there is room
  kFailed,    // the folder cannot be written: rights, gone, a dead disk; tries again and again
};

struct JournalStatus {
  JournalState state = JournalState::kIdle;
  std::string file;                    // being written, else the last one
  std::string what;                    // for kDiskFull and kFailed: what failed, on which path
  std::uint64_t messages_written = 0;  // on the disk; this and the next four since construction
  std::uint64_t messages_dropped = 0;  // the queue was full: the disk is too slow, or not to be had
  std::uint64_t bytes_written = 0;
  std::uint64_t files_begun = 0;
  std::uint64_t files_deleted = 0;  // oldest ones, for total_max_bytes
  std::int64_t total_bytes = 0;     // of all journal files in the folder
};

// The record of a process: MCAP files in a folder, written by a thread of its own. Nothing that
// happens to the disk reaches the caller: Add copies into memory that was taken at the start, waits
// for no file and never fails louder than with `false`.
//
// Files are named journal_YYYYMMDDTHHMMSSZ_NNN.mcap: the log time of the first message in it (UTC),
// and a number that only grows in one folder. The number gives the order; the time is the clock's,
// which may be set back. A new file begins after file_max_duration, at an eighth of
// total_max_bytes, at UTC midnight, and when log times go back by more than kClockSetBack, so that
// times within one file stand in order.
//
// A power cut at any byte costs the chunk that was being written: each is on the disk (fdatasync)
// before the next begins. The file then has no footer; it is left as it is, readable for whoever
// reads from the front, and the next start begins a new file. `tbm repair` makes a copy with a
// footer. After a disk error the messages of the failed chunk are written again into the next file;
// should they turn out to stand in both, they have the same sequence number.
//
// Sequence numbers run for each channel from 1, across files; a gap is what was dropped.
class Journal {
 public:
  using Channel = std::uint16_t;

  explicit Journal(JournalOptions options);
  // Writes what is queued, when the disk can be written, and closes the file with its footer.
  ~Journal();
  Journal(const Journal&) = delete;
  Journal& operator=(const Journal&) = delete;

  // Any thread, at any time; each call makes a channel of its own.
  Channel AddChannel(JournalChannel channel);

  // Any thread. `log_time` is when it was received or made here, `publish_time` when its sender
  // sent it. False when it was dropped. No heap.
  bool Add(Channel channel, BytesView data, Timestamp log_time, Timestamp publish_time);

  // Waits until all that was added before is on the disk. False when that did not come true in
  // time.
  bool Flush(std::chrono::milliseconds timeout);

  // What the destructor does; afterwards Add drops.
  void Close();

  JournalStatus status() const;

 private:
  class Work;
  std::unique_ptr<Work> work_;
};

}  // namespace tbm

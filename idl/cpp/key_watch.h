#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "idl/cpp/alarm.h"
#include "pose/base/fixed_vector.h"

namespace tbm::dds {

// Watches the keys of one reader: which of them have fallen silent, and which have two writers.
// Knows no DDS and no clock of its own. Not thread-safe.
class KeyWatch {
 public:
  using Id = std::array<std::uint8_t, 16>;  // instance handle or writer GUID
  using Instant = std::chrono::steady_clock::time_point;
  // `name`: of the key; empty: of the topic.
  using Raise =
      std::function<void(AlarmKind, bool active, const std::string& name, const std::string& text)>;

  // silent_after 0: silence is normal. At most max_keys keys are watched, further ones are not.
  KeyWatch(std::chrono::milliseconds silent_after, std::size_t max_keys, Raise raise);

  // A sample of `key` came from `writer`. `name_of_key` is asked once per key. True: the key has
  // two writers that are both alive.
  template <class NameOfKey>
  bool Heard(const Id& key, const Id& writer, Instant now, const NameOfKey& name_of_key) {
    Key* known = Find(key);
    if (known == nullptr && keys_.size() < max_keys_) {
      keys_.push_back({key, name_of_key(), writer, now, {}, {}, false, false});
      known = &keys_.back();
    }
    return known != nullptr && Heard(*known, writer, now);
  }

  // DDS says that the key's writers have left.
  void Left(const Id& key, const std::string& why);

  // DDS says that the key has missed its deadline. Its timer runs for all keys of a reader, and one
  // that goes off while a new key's first sample comes in is laid at that key's door: believed only
  // when nothing was heard for nine tenths of the time. Poll finds the rest.
  void MissedDeadline(const Id& key, Instant now);

  // How many writers are matched: one that never sends anything is silence too.
  void Matched(int writers, Instant now);

  // Finds what has been silent for too long and what is no longer contested.
  void Poll(Instant now);

  void Clear();

 private:
  struct Key {
    Id id{};
    std::string name;
    Id writer{};
    Instant heard_at;
    FixedVector<Id, 4> earlier;  // writers that were heard before another took over
    Instant contested_until;
    bool is_silent = false;
    bool is_contested = false;
  };

  Key* Find(const Id& key);
  bool Heard(Key& key, const Id& writer, Instant now);
  void FallSilent(Key& key, const std::string& why);

  const std::chrono::milliseconds silent_after_;
  const std::size_t max_keys_;
  const Raise raise_;
  std::vector<Key> keys_;
  int matched_writers_ = 0;
  Instant matched_at_;
  bool is_mute_ = false;  // matched, but not one sample
};

}  // namespace tbm::dds

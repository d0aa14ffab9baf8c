#include "idl/cpp/key_watch.h"

#include <algorithm>

#include <fmt/format.h>

namespace tbm::dds {
namespace {

// A second writer counts as gone when it has not interrupted the first for this long.
constexpr std::chrono::seconds kContestMemory{5};

}  // namespace

KeyWatch::KeyWatch(std::chrono::milliseconds silent_after, std::size_t max_keys, Raise raise)
    : silent_after_(silent_after), max_keys_(max_keys), raise_(std::move(raise)) {
  keys_.reserve(max_keys_);
}

KeyWatch::Key* KeyWatch::Find(const Id& key) {
  const auto found =
      std::find_if(keys_.begin(), keys_.end(), [&](const Key& known) { return known.id == key; });
  return found == keys_.end() ? nullptr : &*found;
}

bool KeyWatch::Heard(Key& key, const Id& writer, Instant now) {
  if (key.is_silent)
    raise_(AlarmKind::kSilent, false, key.name, fmt::format("{} is heard again", key.name));
  key.is_silent = false;
  if (is_mute_) raise_(AlarmKind::kSilent, false, "", "samples arrive");
  is_mute_ = false;
  key.heard_at = now;
  if (writer == key.writer) return key.is_contested;

  // A restarted process has a new GUID and the old one is never heard again: a take-over. Only a
  // writer that comes back after another has spoken proves that both are alive.
  const bool came_back =
      std::find(key.earlier.begin(), key.earlier.end(), writer) != key.earlier.end();
  if (key.earlier.full()) key.earlier.erase(0);
  key.earlier.push_back(key.writer);
  key.writer = writer;
  if (!came_back) return key.is_contested;
  key.contested_until = now + kContestMemory;
  if (!key.is_contested) {
    raise_(AlarmKind::kSecondWriter, true, key.name, fmt::format("{} has two writers", key.name));
  }
  key.is_contested = true;
  return true;
}

void KeyWatch::FallSilent(Key& key, const std::string& why) {
  if (key.is_silent || silent_after_.count() == 0) return;
  key.is_silent = true;
  raise_(AlarmKind::kSilent, true, key.name, fmt::format("{} {}", key.name, why));
}

void KeyWatch::Left(const Id& key, const std::string& why) {
  if (Key* known = Find(key)) FallSilent(*known, why);
}

void KeyWatch::MissedDeadline(const Id& key, Instant now) {
  Key* known = Find(key);
  if (known == nullptr || now - known->heard_at < silent_after_ * 9 / 10) return;
  FallSilent(*known, "has missed its deadline");
}

void KeyWatch::Matched(int writers, Instant now) {
  if (matched_writers_ == 0 && writers > 0) matched_at_ = now;
  matched_writers_ = writers;
  if (writers == 0 && is_mute_) {
    is_mute_ = false;
    raise_(AlarmKind::kSilent, false, "", "the writer that sent nothing has left");
  }
}

void KeyWatch::Poll(Instant now) {
  for (Key& key : keys_) {
    if (now - key.heard_at > silent_after_) {
      FallSilent(key, fmt::format("has not been heard for {} ms", silent_after_.count()));
    }
    if (key.is_contested && now > key.contested_until) {
      key.is_contested = false;
      raise_(AlarmKind::kSecondWriter,
             false,
             key.name,
             fmt::format("{} has one writer again", key.name));
    }
  }
  if (silent_after_.count() > 0 && matched_writers_ > 0 && keys_.empty() && !is_mute_ &&
      now - matched_at_ > silent_after_) {
    is_mute_ = true;
    raise_(AlarmKind::kSilent, true, "", "a writer is there, but not one sample has come");
  }
}

void KeyWatch::Clear() {
  keys_.clear();
  matched_writers_ = 0;
  is_mute_ = false;
}

}  // namespace tbm::dds

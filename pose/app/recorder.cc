#include "pose/app/recorder.h"

namespace tbm {

Recorder::Recorder(const RecorderOptions& options) : writer_(options) {
  for (std::size_t i = 0; i < kBuffers; ++i) free_buffers_.push_back(i);
  thread_ = std::thread([this] { Run(); });
}

Recorder::~Recorder() {
  {
    const std::lock_guard lock(mutex_);
    is_ending_ = true;
  }
  news_.notify_one();
  thread_.join();
}

void Recorder::Begin(Timestamp now, std::string solver_state) {
  wants_new_run_ = false;
  {
    const std::lock_guard lock(mutex_);
    if (queue_.size() + kBuffers > kQueue) return Gap();
    begin_state_ = std::move(solver_state);
  }
  is_in_gap_ = false;
  Item item;
  item.kind = Kind::kBegin;
  item.at = now;
  Push(item);
}

void Recorder::Add(const TiltReading& reading) {
  if (is_in_gap_) return;
  Item item;
  item.kind = Kind::kTilt;
  item.reading = reading;
  Push(item);
}

void Recorder::Add(const OwnedFrame& frame, PoseReason image_fault) {
  if (is_in_gap_) return;
  Item item;
  item.kind = Kind::kFrame;
  item.at = frame.frame.sensed_at;
  item.image_fault = image_fault;
  if (image_fault == PoseReason::kNone) {
    {
      const std::lock_guard lock(mutex_);
      if (free_buffers_.empty()) return Gap();
      item.buffer = free_buffers_.back();
      free_buffers_.erase(free_buffers_.size() - 1);
    }
    buffers_[item.buffer].CopyFrom(frame.frame);
  }
  Push(item);
}

void Recorder::Push(const Item& item) {
  {
    const std::lock_guard lock(mutex_);
    if (queue_.full()) {
      if (item.kind == Kind::kFrame && item.image_fault == PoseReason::kNone) {
        free_buffers_.push_back(item.buffer);
      }
      return Gap();
    }
    queue_.push_back(item);
  }
  news_.notify_one();
}

// With mutex_ held, in the solver's thread.
void Recorder::Gap() {
  ++frames_dropped_;
  is_in_gap_ = true;
  wants_new_run_ = true;
}

Recorder::Status Recorder::status() const {
  const std::lock_guard lock(mutex_);
  return {status_, frames_dropped_};
}

void Recorder::Run() {
  FixedVector<Item, kQueue> batch;
  std::unique_lock lock(mutex_);
  for (;;) {
    // A full disk gets room again without any news from the solver.
    news_.wait_for(lock, std::chrono::seconds(1), [this] { return is_ending_ || !queue_.empty(); });
    if (queue_.empty() && is_ending_) break;
    batch = queue_;
    queue_.clear();
    lock.unlock();
    for (const Item& item : batch) Write(item);
    if (writer_.WantsNewRun() && std::chrono::steady_clock::now() >= next_try_) {
      wants_new_run_ = true;
    }
    const RecorderStatus status = writer_.status();
    lock.lock();
    status_ = status;
  }
  lock.unlock();
  writer_.Close();
}

void Recorder::Write(const Item& item) {
  switch (item.kind) {
    case Kind::kBegin: {
      std::string state;
      {
        const std::lock_guard lock(mutex_);
        state = begin_state_;
      }
      if (!writer_.Begin(item.at, state)) next_try_ = std::chrono::steady_clock::now() + kTryAgain;
      return;
    }
    case Kind::kTilt:
      writer_.AddTilt(item.reading);
      return;
    case Kind::kFrame:
      if (item.image_fault != PoseReason::kNone) {
        writer_.AddFaultyFrame(item.at, item.image_fault);
        return;
      }
      writer_.AddFrame(item.at, buffers_[item.buffer].frame.image);
      const std::lock_guard lock(mutex_);
      free_buffers_.push_back(item.buffer);
      return;
  }
}

}  // namespace tbm

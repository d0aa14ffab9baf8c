#include "idl/cpp/subscriber.h"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <vector>

#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fmt/format.h>

#include "idl/cpp/fastdds_setup.h"
#include "idl/cpp/key_watch.h"
#include "idl/cpp/participant_core.h"
#include "idl/cpp/wire_type.h"
#include "pose/base/check.h"

namespace tbm::dds {
namespace {

constexpr std::chrono::seconds kRejectedAlarmPeriod{1};

std::string NameOfKey(const FrameFeatures& m) { return std::string(m.machine_id.view()); }
std::string NameOfKey(const TiltReading& m) {
  return fmt::format("{}/{}", m.machine_id.view(), m.sensor.view());
}
std::string NameOfKey(const RelativePose& m) { return std::string(m.machine_id.view()); }
std::string NameOfKey(const DeviceHealth& m) {
  return fmt::format("{}/{}", m.machine_id.view(), m.device_id.view());
}
std::string NameOfKey(const Event& m) {
  return fmt::format("{}/{}/{}", m.machine_id.view(), m.source.view(), m.code.view());
}
std::string NameOfKey(const StationObservation& m) {
  return fmt::format("{}/{}", m.machine_id.view(), m.station.view());
}
std::string NameOfKey(const StationSetUp& m) {
  return fmt::format("{}/{}", m.machine_id.view(), m.role.view());
}
std::string NameOfKey(const ShieldPose& m) {
  return fmt::format("{}/{}", m.machine_id.view(), m.shield.view());
}
std::string NameOfKey(const Guidance& m) { return std::string(m.machine_id.view()); }
std::string NameOfKey(const AlarmStatus& m) {
  return fmt::format("{}/{}/{}", m.machine_id.view(), m.source.view(), m.code.view());
}
std::string NameOfKey(const Command& m) { return std::string(m.machine_id.view()); }
std::string NameOfKey(const CommandReply& m) {
  return fmt::format("{}/{}", m.machine_id.view(), m.source.view());
}
std::string NameOfKey(const TrolleyState& m) { return std::string(m.machine_id.view()); }
std::string NameOfKey(const RailLinePiece& m) {
  return fmt::format("{}/{}", m.machine_id.view(), m.piece);
}
std::string NameOfKey(const SettlementPiece& m) {
  return fmt::format("{}/{}", m.machine_id.view(), m.piece);
}
std::string NameOfKey(const CalibrationStatus& m) {
  return fmt::format("{}/{}", m.machine_id.view(), m.subject.view());
}

KeyWatch::Id IdOf(const rtps::InstanceHandle_t& handle) {
  KeyWatch::Id id{};
  for (std::size_t i = 0; i < id.size(); ++i) id[i] = handle.value[i];
  return id;
}
KeyWatch::Id IdOf(const rtps::GUID_t& guid) {
  KeyWatch::Id id{};
  std::copy_n(guid.guidPrefix.value, 12, id.begin());
  std::copy_n(guid.entityId.value, 4, id.begin() + 12);
  return id;
}

}  // namespace

template <class Message>
class Subscriber<Message>::Impl final : public Endpoint, private fdds::DataReaderListener {
 public:
  Impl(ParticipantCore& core, Handler handler, const SubscriberOptions& options)
      : core_(core),
        handler_(std::move(handler)),
        options_(options),
        type_(new WireType<Message>),
        watch_(
            options.silent_after.count() > 0 ? options.silent_after : kRule.deadline,
            static_cast<std::size_t>(kRule.max_keys),
            [this](AlarmKind kind, bool active, const std::string& name, const std::string& text) {
              core_.Raise({kind, active, std::string(kTopic.name), name, text});
            }) {
    TBM_CHECK(options_.silent_after.count() == 0 || options_.silent_after >= kRule.deadline);
    TBM_CHECK(options_.queue_capacity > 0);
    if (!handler_) queue_.resize(options_.queue_capacity);
    core_.Attach(*this);
  }
  ~Impl() override { core_.Detach(*this); }

  bool Take(Message& message, SampleFacts& facts, std::chrono::milliseconds timeout) {
    std::unique_lock lock(queue_mutex_);
    if (!arrived_.wait_for(lock, timeout, [this] { return queued_ > 0; })) return false;
    message = queue_[first_].message;
    facts = queue_[first_].facts;
    first_ = (first_ + 1) % queue_.size();
    --queued_;
    return true;
  }

  int matched_writers() const { return matched_; }
  SubscriberCounters counters() const {
    const std::lock_guard lock(counters_mutex_);
    return counters_;
  }

  void Open(const Entities& entities) override {
    subscriber_ = entities.subscriber;
    fdds::Topic* topic = TopicIn(*entities.participant, kTopic.name, type_);
    if (topic != nullptr) {
      reader_ = subscriber_->create_datareader(
          topic, ReaderQosFor(kTopic.qos, options_.silent_after), this, Statuses());
    }
    if (reader_ == nullptr) {
      core_.Raise({AlarmKind::kStartFailed,
                   true,
                   std::string(kTopic.name),
                   "reader",
                   "no reader could be made"});
    }
  }

  void Close() override {
    if (reader_ != nullptr) {
      reader_->set_listener(nullptr);
      subscriber_->delete_datareader(reader_);
    }
    reader_ = nullptr;
    matched_ = 0;
    const std::lock_guard lock(watch_mutex_);
    watch_.Clear();
  }

  void Poll() override {
    const std::lock_guard lock(watch_mutex_);
    watch_.Poll(std::chrono::steady_clock::now());
  }

 private:
  static constexpr TopicRow kTopic = TopicOf<Message>();
  static constexpr QosRule kRule = RuleOf(kTopic.qos);
  using Wire = typename WireOf<Message>::Type;

  struct Entry {
    Message message;
    SampleFacts facts;
  };

  static fdds::StatusMask Statuses() {
    return fdds::StatusMask::data_available()
           << fdds::StatusMask::subscription_matched()
           << fdds::StatusMask::requested_deadline_missed()
           << fdds::StatusMask::requested_incompatible_qos() << fdds::StatusMask::sample_lost();
  }

  void on_data_available(fdds::DataReader* reader) override {
    const std::lock_guard lock(receive_mutex_);
    fdds::SampleInfo info;
    while (reader->take_next_sample(&sample_, &info) ==
           eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
      if (info.valid_data) {
        Receive(info);
      } else {
        const std::lock_guard watching(watch_mutex_);
        watch_.Left(IdOf(info.instance_handle), "has no writer any more");
      }
    }
  }

  void Receive(const fdds::SampleInfo& info) {
    const rtps::GUID_t writer = info.sample_identity.writer_guid();
    if (core_.IsForeign(writer.guidPrefix)) {
      const std::lock_guard lock(counters_mutex_);
      ++counters_.from_other_interface;
      return;
    }
    const BoundaryFault fault =
        sample_.is_well_formed ? Check(sample_.value) : BoundaryFault::kMalformed;
    if (fault != BoundaryFault::kNone) {
      Reject(fault);
      return;
    }
    FromWire(sample_.value, message_);
    SampleFacts facts;
    facts.received_at = std::chrono::steady_clock::now();
    facts.writer = IdOf(writer);
    if (kRule.one_writer) {
      const std::lock_guard lock(watch_mutex_);
      facts.contested =
          watch_.Heard(IdOf(info.instance_handle), facts.writer, facts.received_at, [this] {
            return NameOfKey(message_);
          });
    }
    {
      const std::lock_guard lock(counters_mutex_);
      ++counters_.delivered;
    }
    if (handler_) {
      handler_(message_, facts);
    } else {
      Enqueue(facts);
    }
  }

  void Reject(BoundaryFault fault) {
    std::uint64_t rejected = 0;
    {
      const std::lock_guard lock(counters_mutex_);
      rejected = ++counters_.rejected;
      counters_.rejected_because = fault;
    }
    const auto now = std::chrono::steady_clock::now();
    if (rejected > 1 && now - rejected_alarm_at_ < kRejectedAlarmPeriod) return;
    rejected_alarm_at_ = now;
    core_.Raise({AlarmKind::kRejected,
                 true,
                 std::string(kTopic.name),
                 "",
                 fmt::format("a sample is refused: {}; {} so far", FaultText(fault), rejected)});
  }

  void Enqueue(const SampleFacts& facts) {
    bool has_dropped = false;
    {
      const std::lock_guard lock(queue_mutex_);
      has_dropped = queued_ == queue_.size();
      if (has_dropped) {
        first_ = (first_ + 1) % queue_.size();
        --queued_;
      }
      Entry& entry = queue_[(first_ + queued_) % queue_.size()];
      entry.message = message_;
      entry.facts = facts;
      ++queued_;
    }
    arrived_.notify_one();
    if (has_dropped) {
      const std::lock_guard lock(counters_mutex_);
      ++counters_.dropped;
    }
  }

  void on_subscription_matched(fdds::DataReader*,
                               const fdds::SubscriptionMatchedStatus& status) override {
    matched_ = status.current_count;
    const std::lock_guard lock(watch_mutex_);
    watch_.Matched(status.current_count, std::chrono::steady_clock::now());
  }
  void on_requested_deadline_missed(
      fdds::DataReader*, const eprosima::fastrtps::RequestedDeadlineMissedStatus& status) override {
    const std::lock_guard lock(watch_mutex_);
    watch_.MissedDeadline(IdOf(status.last_instance_handle), std::chrono::steady_clock::now());
  }
  void on_requested_incompatible_qos(fdds::DataReader*,
                                     const fdds::RequestedIncompatibleQosStatus& status) override {
    core_.Raise({AlarmKind::kIncompatibleQos,
                 true,
                 std::string(kTopic.name),
                 "reader",
                 fmt::format("a writer does not offer the {} that this reader asks for: nothing "
                             "comes from it",
                             PolicyName(status.last_policy_id))});
  }
  void on_sample_lost(fdds::DataReader*, const fdds::SampleLostStatus& status) override {
    const std::lock_guard lock(counters_mutex_);
    counters_.lost = static_cast<std::uint64_t>(status.total_count);
  }

  ParticipantCore& core_;
  const Handler handler_;
  const SubscriberOptions options_;
  fdds::TypeSupport type_;
  fdds::Subscriber* subscriber_ = nullptr;
  fdds::DataReader* reader_ = nullptr;
  std::atomic<int> matched_ = 0;

  std::mutex receive_mutex_;  // guards all down to the next mutex
  WireSample<Wire> sample_;
  Message message_;
  std::chrono::steady_clock::time_point rejected_alarm_at_;

  std::mutex watch_mutex_;  // no DDS call is made under it: DDS calls us with its own locks held
  KeyWatch watch_;

  mutable std::mutex counters_mutex_;
  SubscriberCounters counters_;

  std::mutex queue_mutex_;  // guards the ring of `queued_` entries that begins at `first_`
  std::condition_variable arrived_;
  std::vector<Entry> queue_;
  std::size_t first_ = 0;
  std::size_t queued_ = 0;
};

template <class Message>
Subscriber<Message>::Subscriber(Participant& participant,
                                Handler handler,
                                const SubscriberOptions& options)
    : impl_(std::make_unique<Impl>(participant.core(), std::move(handler), options)) {}
template <class Message>
Subscriber<Message>::Subscriber(Participant& participant, const SubscriberOptions& options)
    : impl_(std::make_unique<Impl>(participant.core(), Handler{}, options)) {}
template <class Message>
Subscriber<Message>::~Subscriber() = default;
template <class Message>
bool Subscriber<Message>::Take(Message& message,
                               SampleFacts& facts,
                               std::chrono::milliseconds timeout) {
  return impl_->Take(message, facts, timeout);
}
template <class Message>
int Subscriber<Message>::matched_writers() const {
  return impl_->matched_writers();
}
template <class Message>
SubscriberCounters Subscriber<Message>::counters() const {
  return impl_->counters();
}

template class Subscriber<FrameFeatures>;
template class Subscriber<TiltReading>;
template class Subscriber<RelativePose>;
template class Subscriber<DeviceHealth>;
template class Subscriber<Event>;
template class Subscriber<StationObservation>;
template class Subscriber<StationSetUp>;
template class Subscriber<ShieldPose>;
template class Subscriber<Guidance>;
template class Subscriber<AlarmStatus>;
template class Subscriber<Command>;
template class Subscriber<CommandReply>;
template class Subscriber<TrolleyState>;
template class Subscriber<RailLinePiece>;
template class Subscriber<SettlementPiece>;
template class Subscriber<CalibrationStatus>;

}  // namespace tbm::dds

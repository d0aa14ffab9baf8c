#include "idl/cpp/publisher.h"

#include <atomic>
#include <mutex>
#include <vector>

#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fmt/format.h>

#include "idl/cpp/fastdds_setup.h"
#include "idl/cpp/participant_core.h"
#include "idl/cpp/wire_type.h"

namespace tbm::dds {
namespace {

void Reserve(v1::FrameFeatures& wire) { wire.spots().reserve(kMaxSpots); }
void Reserve(v1::RelativePose& wire) { wire.points().reserve(kMaxPoints); }
template <class Wire>
void Reserve(Wire&) {}

}  // namespace

template <class Message>
class Publisher<Message>::Impl final : public Endpoint, private fdds::DataWriterListener {
 public:
  explicit Impl(ParticipantCore& core) : core_(core), type_(new WireType<Message>) {
    Reserve(sample_.value);
    // Standing states survive a change of network only when somebody remembers them.
    if (kRule.transient_local) standing_.reserve(static_cast<std::size_t>(kRule.max_keys));
    core_.Attach(*this);
  }
  ~Impl() override { core_.Detach(*this); }

  WriteOutcome Write(const Message& message) {
    const std::lock_guard lock(mutex_);
    ToWire(message, sample_.value);
    sample_.is_well_formed = true;
    if (const BoundaryFault fault = Check(sample_.value); fault != BoundaryFault::kNone) {
      ++counters_.refused;
      counters_.refused_because = fault;
      return WriteOutcome::kRefused;
    }
    if (kRule.transient_local) Remember(message);
    if (writer_ == nullptr) {
      ++counters_.without_network;
      return WriteOutcome::kNoNetwork;
    }
    if (!writer_->write(&sample_)) {
      ++counters_.failed;
      return WriteOutcome::kFailed;
    }
    ++counters_.written;
    return WriteOutcome::kWritten;
  }

  int matched_readers() const { return matched_; }
  PublisherCounters counters() const {
    const std::lock_guard lock(mutex_);
    return counters_;
  }

  void Open(const Entities& entities) override {
    const std::lock_guard lock(mutex_);
    publisher_ = entities.publisher;
    fdds::Topic* topic = TopicIn(*entities.participant, kTopic.name, type_);
    if (topic != nullptr) {
      writer_ = publisher_->create_datawriter(topic, WriterQosFor(kTopic.qos), this, kStatuses);
    }
    if (writer_ == nullptr) {
      core_.Raise({AlarmKind::kStartFailed,
                   true,
                   std::string(kTopic.name),
                   "writer",
                   "no writer could be made"});
      return;
    }
    for (const Message& message : standing_) {
      ToWire(message, sample_.value);
      writer_->write(&sample_);
    }
  }

  void Close() override {
    const std::lock_guard lock(mutex_);
    if (writer_ != nullptr) publisher_->delete_datawriter(writer_);
    writer_ = nullptr;
    matched_ = 0;
  }

  void Poll() override {}

 private:
  static constexpr TopicRow kTopic = TopicOf<Message>();
  static constexpr QosRule kRule = RuleOf(kTopic.qos);
  inline static const fdds::StatusMask kStatuses = fdds::StatusMask::publication_matched()
                                                   << fdds::StatusMask::offered_incompatible_qos();

  // The newest message of each key; the oldest key makes room.
  void Remember(const Message& message) {
    for (Message& known : standing_) {
      if (SameKey(known, message)) {
        known = message;
        return;
      }
    }
    if (standing_.size() == static_cast<std::size_t>(kRule.max_keys)) {
      standing_.erase(standing_.begin());
    }
    standing_.push_back(message);
  }

  void on_publication_matched(fdds::DataWriter*,
                              const fdds::PublicationMatchedStatus& status) override {
    matched_ = status.current_count;
  }
  void on_offered_incompatible_qos(fdds::DataWriter*,
                                   const fdds::OfferedIncompatibleQosStatus& status) override {
    core_.Raise(
        {AlarmKind::kIncompatibleQos,
         true,
         std::string(kTopic.name),
         "writer",
         fmt::format("a reader asks for {} that this writer does not offer: it gets nothing",
                     PolicyName(status.last_policy_id))});
  }

  ParticipantCore& core_;
  fdds::TypeSupport type_;
  mutable std::mutex mutex_;
  WireSample<typename WireOf<Message>::Type> sample_;
  std::vector<Message> standing_;
  PublisherCounters counters_;
  fdds::Publisher* publisher_ = nullptr;
  fdds::DataWriter* writer_ = nullptr;
  std::atomic<int> matched_ = 0;
};

template <class Message>
Publisher<Message>::Publisher(Participant& participant)
    : impl_(std::make_unique<Impl>(participant.core())) {}
template <class Message>
Publisher<Message>::~Publisher() = default;
template <class Message>
WriteOutcome Publisher<Message>::Write(const Message& message) {
  return impl_->Write(message);
}
template <class Message>
int Publisher<Message>::matched_readers() const {
  return impl_->matched_readers();
}
template <class Message>
PublisherCounters Publisher<Message>::counters() const {
  return impl_->counters();
}

template class Publisher<FrameFeatures>;
template class Publisher<TiltReading>;
template class Publisher<RelativePose>;
template class Publisher<DeviceHealth>;
template class Publisher<Event>;
template class Publisher<StationObservation>;
template class Publisher<StationSetUp>;
template class Publisher<ShieldPose>;
template class Publisher<Guidance>;
template class Publisher<AlarmStatus>;
template class Publisher<Command>;
template class Publisher<CommandReply>;
template class Publisher<TrolleyState>;
template class Publisher<RailLinePiece>;
template class Publisher<SettlementPiece>;
template class Publisher<CalibrationStatus>;

}  // namespace tbm::dds

#pragma once

#include <string_view>

#include "idl/cpp/guidance_messages.h"
#include "idl/cpp/messages.h"
#include "idl/cpp/rail_messages.h"

// Enumerators of the contract as the words that stand on screens, in tables and in JSON.
namespace tbm::dds {

constexpr std::string_view WordOf(Validity validity) {
  switch (validity) {
    case Validity::kInvalid:
      return "invalid";
    case Validity::kDegraded:
      return "degraded";
    case Validity::kValid:
      return "valid";
  }
  return "";
}

constexpr std::string_view WordOf(SourceFreshness freshness) {
  switch (freshness) {
    case SourceFreshness::kMissing:
      return "missing";
    case SourceFreshness::kStale:
      return "stale";
    case SourceFreshness::kCoasting:
      return "coasting";
    case SourceFreshness::kFresh:
      return "fresh";
  }
  return "";
}

constexpr std::string_view WordOf(SetUpState state) {
  switch (state) {
    case SetUpState::kNone:
      return "none";
    case SetUpState::kSuspect:
      return "suspect";
    case SetUpState::kGood:
      return "good";
  }
  return "";
}

constexpr std::string_view WordOf(ObservationStatus status) {
  switch (status) {
    case ObservationStatus::kNone:
      return "none";
    case ObservationStatus::kDegraded:
      return "degraded";
    case ObservationStatus::kGood:
      return "good";
  }
  return "";
}

constexpr std::string_view WordOf(AlarmPhase phase) {
  switch (phase) {
    case AlarmPhase::kNormal:
      return "normal";
    case AlarmPhase::kUnacknowledged:
      return "unacknowledged";
    case AlarmPhase::kAcknowledged:
      return "acknowledged";
    case AlarmPhase::kReturnedUnacknowledged:
      return "returned_unacknowledged";
  }
  return "";
}

constexpr std::string_view WordOf(AlarmUrgency urgency) {
  switch (urgency) {
    case AlarmUrgency::kLow:
      return "low";
    case AlarmUrgency::kMedium:
      return "medium";
    case AlarmUrgency::kHigh:
      return "high";
  }
  return "";
}

constexpr std::string_view WordOf(CommandOutcome outcome) {
  switch (outcome) {
    case CommandOutcome::kAccepted:
      return "accepted";
    case CommandOutcome::kDone:
      return "done";
    case CommandOutcome::kRefused:
      return "refused";
    case CommandOutcome::kFailed:
      return "failed";
  }
  return "";
}

constexpr std::string_view WordOf(RailPointStatus status) {
  switch (status) {
    case RailPointStatus::kNone:
      return "none";
    case RailPointStatus::kGap:
      return "gap";
    case RailPointStatus::kOpen:
      return "open";
    case RailPointStatus::kBridged:
      return "bridged";
    case RailPointStatus::kFixed:
      return "fixed";
  }
  return "";
}

constexpr std::string_view WordOf(CalibrationState state) {
  switch (state) {
    case CalibrationState::kNone:
      return "none";
    case CalibrationState::kUndated:
      return "undated";
    case CalibrationState::kDue:
      return "due";
    case CalibrationState::kValid:
      return "valid";
  }
  return "";
}

}  // namespace tbm::dds

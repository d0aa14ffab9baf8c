#pragma once

#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "hmi_bridge/core/own_alarms.h"
#include "hmi_bridge/server/private_folder.h"

namespace tbm::hmi {

// Which events somebody has answered, so that a restart of the bridge does not ask again. What
// cannot be read is as if nobody had: an alarm too many, none too few.
class AnswerFile {
 public:
  explicit AnswerFile(PrivateFolder folder) : folder_(std::move(folder)) {}

  std::map<std::string, Answer> Load() const;
  // Whole or not at all. A disk that takes nothing costs one question more after a restart.
  void Keep(const std::map<std::string, Answer>& answers) const;

 private:
  PrivateFolder folder_;
};

std::string AnswerText(const std::map<std::string, Answer>& answers);
std::map<std::string, Answer> AnswersFrom(std::string_view text);

}  // namespace tbm::hmi

#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "hmi_bridge/server/console_source.h"
#include "hmi_bridge/server/secrets.h"
#include "pose/base/result.h"

namespace tbm::hmi {

// What the files of the state folder say. JSON that a person can read; every key must be there and
// no other, so that a slip of the editor is told and never half believed.

std::optional<Role> RoleFromWord(std::string_view word);
// Letters, digits, '.', '_', '-'; 1 to 32: what logs, headers and file lines take as it is.
bool IsName(std::string_view name);

struct User {
  std::string name;
  Role role = Role::kViewer;
  // Drawn anew with each change of password or role: sessions that were opened under another one
  // are worth nothing, also when a power cut falls between two files.
  std::string edition;
  PasswordHash password;
};

struct Session {
  std::string token_sha256;
  std::string user;
  std::string edition;
  std::int64_t created_utc_ms = 0;
  std::int64_t used_utc_ms = 0;
};

struct ReadToken {
  std::string token_sha256;
  std::string name;
  std::int64_t created_utc_ms = 0;
};

std::string TextOf(const std::vector<User>& users);
std::string TextOf(const std::vector<Session>& sessions);
std::string TextOf(const std::vector<ReadToken>& tokens);

// The error begins with `file`, says where and what is wrong, and what to do.
Result<std::vector<User>, std::string> ParseUsers(std::string_view text, const std::string& file);
Result<std::vector<Session>, std::string> ParseSessions(std::string_view text,
                                                        const std::string& file);
Result<std::vector<ReadToken>, std::string> ParseReadTokens(std::string_view text,
                                                            const std::string& file);

}  // namespace tbm::hmi

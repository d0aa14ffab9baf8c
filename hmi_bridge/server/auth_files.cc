#include "hmi_bridge/server/auth_files.h"

#include <algorithm>
#include <initializer_list>
#include <optional>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "hmi_bridge/server/json_text.h"

namespace tbm::hmi {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMostRows = 10'000;
constexpr std::int64_t kMost_utc_ms = 253'402'300'799'000;  // the year 9999

// One row of a file, key by key; remembers the first thing that is wrong.
class Row {
 public:
  Row(const Json& json, std::string place) : json_(json), place_(std::move(place)) {}

  void Keys(std::initializer_list<std::string_view> keys) {
    if (!json_.is_object()) return Wrong("", "must be an object");
    for (const auto& [key, value] : json_.items()) {
      if (std::find(keys.begin(), keys.end(), key) == keys.end()) Wrong(key, "is not known");
    }
    for (const std::string_view key : keys) {
      if (!json_.contains(key)) Wrong(key, "is missing");
    }
  }
  std::string Text(const char* key) {
    if (!fault_.empty()) return {};
    if (json_[key].is_string()) return json_[key].get<std::string>();
    Wrong(key, "must be a text");
    return {};
  }
  std::int64_t Integer(const char* key, std::int64_t least, std::int64_t most) {
    if (!fault_.empty()) return least;
    const Json& value = json_[key];
    if (value.is_number_integer()) {
      const bool is_huge = value.is_number_unsigned() &&
                           value.get<std::uint64_t>() > static_cast<std::uint64_t>(INT64_MAX);
      const std::int64_t number = is_huge ? INT64_MAX : value.get<std::int64_t>();
      if (number >= least && number <= most) return number;
    }
    Wrong(key, fmt::format("must be a whole number from {} to {}", least, most));
    return least;
  }
  std::string Name(const char* key) {
    std::string name = Text(key);
    if (fault_.empty() && !IsName(name)) {
      Wrong(key, "must be 1 to 32 letters, digits, '.', '_' or '-'");
    }
    return name;
  }
  // Bytes as hexadecimal digits.
  std::string Bytes(const char* key, std::size_t count) {
    const auto bytes = FromHex(Text(key));
    if (fault_.empty() && (!bytes || bytes->size() != count)) {
      Wrong(key, fmt::format("must be {} digits 0-9a-f", 2 * count));
    }
    return fault_.empty() ? *bytes : std::string();
  }
  Row In(const char* key) const {
    return {fault_.empty() ? json_[key] : json_, place_ + "." + key};
  }
  void Wrong(std::string_view key, std::string_view what) {
    if (fault_.empty())
      fault_ = fmt::format("{}{}{} {}", place_, key.empty() ? "" : ".", key, what);
  }
  const std::string& fault() const { return fault_; }

 private:
  const Json& json_;
  std::string place_;
  std::string fault_;
};

std::string Print(const char* list, Json rows) {
  Json file;
  file["version"] = 1;
  file[list] = std::move(rows);
  return file.dump(1) + "\n";
}

// Reads the frame that the files share, and each row by `read`, which returns what is wrong.
template <class Entry, class Read>
Result<std::vector<Entry>, std::string> ReadList(std::string_view text,
                                                 const std::string& file,
                                                 const char* list,
                                                 std::string_view what_to_do,
                                                 Read read) {
  const auto refuse = [&](std::string_view what) {
    return Failure{fmt::format("{}: {}; nothing of it is used. {}", file, what, what_to_do)};
  };
  if (NestsDeeperThan(text, 4)) return refuse("is nested too deeply");
  const Json json = Json::parse(text.begin(), text.end(), nullptr, false);
  if (json.is_discarded()) return refuse("is no JSON: it was cut or edited");
  Row frame(json, "file");
  frame.Keys({"version", list});
  frame.Integer("version", 1, 1);
  if (!frame.fault().empty()) return refuse(frame.fault());
  const Json& rows = json[list];
  if (!rows.is_array() || rows.size() > kMostRows) {
    return refuse(fmt::format("{} must be a list of at most {}", list, kMostRows));
  }
  std::vector<Entry> entries;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    Row row(rows[i], fmt::format("{}[{}]", list, i));
    Entry entry;
    const std::string fault = read(row, entry);
    if (!fault.empty()) return refuse(fault);
    entries.push_back(std::move(entry));
  }
  return entries;
}

}  // namespace

std::optional<Role> RoleFromWord(std::string_view word) {
  for (const Role role : {Role::kViewer, Role::kOperator, Role::kSurveyor}) {
    if (Word(role) == word) return role;
  }
  return std::nullopt;
}

bool IsName(std::string_view name) {
  constexpr std::string_view kFine =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._-";
  return !name.empty() && name.size() <= 32 &&
         name.find_first_not_of(kFine) == std::string_view::npos;
}

std::string TextOf(const std::vector<User>& users) {
  Json rows = Json::array();
  for (const User& user : users) {
    rows.push_back({{"name", user.name},
                    {"role", Word(user.role)},
                    {"edition", user.edition},
                    {"scrypt",
                     {{"log2_n", user.password.log2_n},
                      {"r", user.password.r},
                      {"p", user.password.p},
                      {"salt", Hex(user.password.salt)},
                      {"key", Hex(user.password.key)}}}});
  }
  return Print("users", std::move(rows));
}

std::string TextOf(const std::vector<Session>& sessions) {
  Json rows = Json::array();
  for (const Session& session : sessions) {
    rows.push_back({{"token_sha256", session.token_sha256},
                    {"user", session.user},
                    {"edition", session.edition},
                    {"created_utc_ms", session.created_utc_ms},
                    {"used_utc_ms", session.used_utc_ms}});
  }
  return Print("sessions", std::move(rows));
}

std::string TextOf(const std::vector<ReadToken>& tokens) {
  Json rows = Json::array();
  for (const ReadToken& token : tokens) {
    rows.push_back({{"token_sha256", token.token_sha256},
                    {"name", token.name},
                    {"created_utc_ms", token.created_utc_ms}});
  }
  return Print("tokens", std::move(rows));
}

Result<std::vector<User>, std::string> ParseUsers(std::string_view text, const std::string& file) {
  std::set<std::string> names;
  return ReadList<User>(
      text,
      file,
      "users",
      "Put a copy of it back, or remove it: the next start then makes a new first user.",
      [&](Row& row, User& user) -> std::string {
        row.Keys({"name", "role", "edition", "scrypt"});
        user.name = row.Name("name");
        const auto role = RoleFromWord(row.Text("role"));
        if (row.fault().empty() && !role) {
          row.Wrong("role", "must be viewer, operator or surveyor");
        }
        user.edition = Hex(row.Bytes("edition", 8));
        if (!row.fault().empty()) return row.fault();
        user.role = *role;
        if (!names.insert(user.name).second) row.Wrong("name", "is there twice");
        Row scrypt = row.In("scrypt");
        scrypt.Keys({"log2_n", "r", "p", "salt", "key"});
        user.password.log2_n = static_cast<int>(scrypt.Integer("log2_n", kLeastLog2N, kMostLog2N));
        user.password.r = static_cast<int>(scrypt.Integer("r", 1, 8));
        user.password.p = static_cast<int>(scrypt.Integer("p", 1, 4));
        user.password.salt = scrypt.Bytes("salt", 16);
        user.password.key = scrypt.Bytes("key", 32);
        return row.fault().empty() ? scrypt.fault() : row.fault();
      });
}

Result<std::vector<Session>, std::string> ParseSessions(std::string_view text,
                                                        const std::string& file) {
  return ReadList<Session>(
      text,
      file,
      "sessions",
      "Remove it: everybody then has to log in again.",
      [](Row& row, Session& session) -> std::string {
        row.Keys({"token_sha256", "user", "edition", "created_utc_ms", "used_utc_ms"});
        session.token_sha256 = Hex(row.Bytes("token_sha256", 32));
        session.user = row.Name("user");
        session.edition = Hex(row.Bytes("edition", 8));
        session.created_utc_ms = row.Integer("created_utc_ms", 0, kMost_utc_ms);
        session.used_utc_ms = row.Integer("used_utc_ms", 0, kMost_utc_ms);
        return row.fault();
      });
}

Result<std::vector<ReadToken>, std::string> ParseReadTokens(std::string_view text,
                                                            const std::string& file) {
  std::set<std::string> names;
  return ReadList<ReadToken>(text,
                             file,
                             "tokens",
                             "Put a copy of it back, or remove it and make the tokens anew.",
                             [&](Row& row, ReadToken& token) -> std::string {
                               row.Keys({"token_sha256", "name", "created_utc_ms"});
                               token.token_sha256 = Hex(row.Bytes("token_sha256", 32));
                               token.name = row.Name("name");
                               token.created_utc_ms =
                                   row.Integer("created_utc_ms", 0, kMost_utc_ms);
                               if (row.fault().empty() && !names.insert(token.name).second) {
                                 row.Wrong("name", "is there twice");
                               }
                               return row.fault();
                             });
}

}  // namespace tbm::hmi

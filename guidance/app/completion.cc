#include "guidance/app/completion.h"

#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

namespace tbm {
namespace {

struct Choice {
  std::vector<std::string> names;   // "--method", "-m"
  std::vector<std::string> values;  // fixed choices; empty: a file or a free value
  bool takes_value = false;
  std::string help;
};

struct Command {
  std::string name;  // "axis check" for a command below a command
  std::string help;
  std::vector<Choice> options;
  std::vector<Choice> positionals;
  std::vector<std::string> subcommands;
};

// CLI11 prints a set of choices as "TEXT:{csv,json}".
std::vector<std::string> ValuesOf(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  const std::size_t start = type.find('{');
  const std::size_t end = type.find('}', start);
  if (start == std::string::npos || end == std::string::npos) return {};
  return CLI::detail::split(type.substr(start + 1, end - start - 1), ',');
}

Choice ChoiceOf(const CLI::Option& option) {
  Choice choice;
  for (const std::string& name : option.get_lnames()) choice.names.push_back("--" + name);
  for (const std::string& name : option.get_snames()) choice.names.push_back("-" + name);
  choice.values = ValuesOf(option);
  choice.takes_value = option.get_items_expected_max() > 0;
  choice.help = option.get_description();
  return choice;
}

std::vector<const CLI::App*> SubcommandsOf(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App*) { return true; });
}

Command CommandOf(const CLI::App& app, const std::string& name) {
  Command command{name, app.get_description(), {}, {}, {}};
  for (const CLI::Option* option : app.get_options()) {
    (option->get_positional() ? command.positionals : command.options).push_back(ChoiceOf(*option));
  }
  for (const CLI::App* sub : SubcommandsOf(app)) command.subcommands.push_back(sub->get_name());
  return command;
}

// The program first, then each command, followed by the commands below it.
std::vector<Command> CommandsOf(const CLI::App& app) {
  std::vector<Command> commands = {CommandOf(app, app.get_name())};
  for (const CLI::App* sub : SubcommandsOf(app)) {
    commands.push_back(CommandOf(*sub, sub->get_name()));
    for (const CLI::App* below : SubcommandsOf(*sub)) {
      commands.push_back(CommandOf(*below, sub->get_name() + " " + below->get_name()));
    }
  }
  return commands;
}

bool IsBelowAnother(const Command& command) { return command.name.find(' ') != std::string::npos; }

std::string Joined(const std::vector<std::string>& words) {
  return fmt::format("{}", fmt::join(words, " "));
}

// What may stand where no option begins: choices of the positionals, commands, else a file.
std::vector<std::string> BareWords(const Command& command) {
  std::vector<std::string> words = command.subcommands;
  for (const Choice& positional : command.positionals) {
    words.insert(words.end(), positional.values.begin(), positional.values.end());
  }
  return words;
}

std::string ZshQuoted(const std::string& text) {
  std::string quoted;
  for (const char c : text) {
    if (c == '\'') {
      quoted += "'\\''";
    } else if (c == '[' || c == ']' || c == ':') {
      quoted += fmt::format("\\{}", c);
    } else {
      quoted += c == '\n' ? ' ' : c;
    }
  }
  return quoted;
}

std::string ZshAction(const Choice& choice) {
  return choice.values.empty() ? ":value:_files"
                               : fmt::format(":value:({})", Joined(choice.values));
}

// The arguments of one command, for _arguments. `indent` is that of its lines.
std::string ZshArguments(const Command& command, const std::string& indent) {
  std::string text = indent + "_arguments";
  for (const Choice& option : command.options) {
    for (const std::string& name : option.names) {
      text += fmt::format(" \\\n{}  '{}[{}]{}'",
                          indent,
                          name,
                          ZshQuoted(option.help),
                          option.takes_value ? ZshAction(option) : "");
    }
  }
  for (std::size_t k = 0; k < command.positionals.size(); ++k) {
    text += fmt::format(" \\\n{}  '{}{}'", indent, k + 1, ZshAction(command.positionals[k]));
  }
  return text;
}

// A command that has commands of its own: their names first, then their arguments.
std::string ZshNested(const Command& command, const std::vector<Command>& commands) {
  std::string text = fmt::format(
      "      if (( CURRENT == 2 )); then\n        compadd {}\n        return\n      fi\n"
      "      local below=$words[2]\n      shift words\n      (( CURRENT-- ))\n"
      "      case $below in\n",
      Joined(command.subcommands));
  for (const std::string& name : command.subcommands) {
    for (const Command& below : commands) {
      if (below.name != command.name + " " + name) continue;
      text += fmt::format("        {})\n{} ;;\n", name, ZshArguments(below, "          "));
    }
  }
  return text + "      esac ;;\n";
}

}  // namespace

std::string BashCompletion(const CLI::App& app) {
  const auto commands = CommandsOf(app);
  std::string text =
      "# bash completion of tbm; use: source <(tbm completion bash)\n"
      "_tbm() {\n"
      "  local word=\"${COMP_WORDS[COMP_CWORD]}\" before=\"${COMP_WORDS[COMP_CWORD-1]}\" "
      "command=''\n"
      "  [ \"$COMP_CWORD\" -gt 1 ] && command=\"${COMP_WORDS[1]}\"\n"
      "  case \"$command ${COMP_WORDS[2]}\" in\n";
  for (const Command& command : commands) {
    if (!IsBelowAnother(command)) continue;
    text += fmt::format(
        "    '{}') [ \"$COMP_CWORD\" -gt 2 ] && command='{}' ;;\n", command.name, command.name);
  }
  text +=
      "  esac\n"
      "  local options='' words='' files=yes\n"
      "  case \"$command\" in\n";
  for (std::size_t i = 0; i < commands.size(); ++i) {
    const Command& command = commands[i];
    std::vector<std::string> options;
    std::string value_cases;
    for (const Choice& option : command.options) {
      options.insert(options.end(), option.names.begin(), option.names.end());
      if (option.values.empty()) continue;
      value_cases +=
          fmt::format("        {}) COMPREPLY=($(compgen -W '{}' -- \"$word\")); return ;;\n",
                      fmt::join(option.names, "|"),
                      Joined(option.values));
    }
    const auto words = BareWords(command);
    text += fmt::format("    '{}')\n", i == 0 ? "" : command.name);
    if (!value_cases.empty()) text += "      case \"$before\" in\n" + value_cases + "      esac\n";
    text += fmt::format("      options='{}'; words='{}'{} ;;\n",
                        Joined(options),
                        Joined(words),
                        words.empty() ? "" : "; files=''");
  }
  text +=
      "  esac\n"
      "  if [[ \"$word\" == -* ]]; then\n"
      "    COMPREPLY=($(compgen -W \"$options\" -- \"$word\"))\n"
      "  elif [ -n \"$files\" ]; then\n"
      "    compopt -o filenames; COMPREPLY=($(compgen -f -- \"$word\"))\n"
      "  else\n"
      "    COMPREPLY=($(compgen -W \"$words\" -- \"$word\"))\n"
      "  fi\n"
      "}\n"
      "complete -F _tbm tbm\n";
  return text;
}

std::string ZshCompletion(const CLI::App& app) {
  const auto commands = CommandsOf(app);
  std::string text =
      "#compdef tbm\n# zsh completion of tbm; use: source <(tbm completion zsh)\n"
      "_tbm() {\n  local -a commands\n  commands=(\n";
  for (std::size_t i = 1; i < commands.size(); ++i) {
    if (IsBelowAnother(commands[i])) continue;
    text += fmt::format("    '{}:{}'\n", commands[i].name, ZshQuoted(commands[i].help));
  }
  text += "  )\n  if (( CURRENT == 2 )); then\n    _describe command commands\n    _arguments";
  for (const Choice& option : commands[0].options) {
    for (const std::string& name : option.names) {
      text += fmt::format(" \\\n      '{}[{}]'", name, ZshQuoted(option.help));
    }
  }
  text +=
      "\n    return\n  fi\n  local command=$words[2]\n  shift words\n  (( CURRENT-- ))\n  case "
      "$command in\n";
  for (std::size_t i = 1; i < commands.size(); ++i) {
    if (IsBelowAnother(commands[i])) continue;
    text += fmt::format("    {})\n", commands[i].name);
    text += commands[i].subcommands.empty() ? ZshArguments(commands[i], "      ") + " ;;\n"
                                            : ZshNested(commands[i], commands);
  }
  text += "  esac\n}\n";
  // Sourced it registers itself; as a file in $fpath the first line does.
  text += "if [ \"$funcstack[1]\" = _tbm ]; then _tbm \"$@\"; else compdef _tbm tbm; fi\n";
  return text;
}

}  // namespace tbm

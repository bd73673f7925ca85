//! The physical effects that a command computes: the switches that all commands share, the rules of
//! each command, and the report of what was decided and why.

use super::error::CliError;
use super::output::ShortNumber;
use crate::effects::{
    self, Effect, EffectDecision, EffectMeasurements, EffectOverride, EffectOverrides, EffectPlan,
    TracePurpose,
};
use crate::lens::{Lens, Wavelength};
use serde::Serialize;
use std::fmt::{self, Display};
use std::str::FromStr;

/// The switches of the effects.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct EffectArgs {
    /// Effects switched by hand, as `aiming=off` or `all=on`; absent: those that the lens and the
    /// command need (see `aplanat help effects`)
    #[arg(long, value_name = "EFFECT=SETTING", value_delimiter = ',')]
    effects: Vec<EffectSwitch>,
}

/// One switch: an effect, or all of them, and its setting.
#[derive(Debug, Clone, Copy)]
struct EffectSwitch {
    /// `None` for all effects that the command can switch.
    effect: Option<Effect>,
    setting: EffectOverride,
}

/// The name of an effect in options.
fn option_name(effect: Effect) -> &'static str {
    match effect {
        Effect::Dispersion => "dispersion",
        Effect::Asphere => "asphere",
        Effect::Clipping => "clipping",
        Effect::TotalReflection => "total-reflection",
        Effect::Aiming => "aiming",
        Effect::FiniteObject => "finite-object",
        Effect::GradientIndex => "gradient",
        Effect::Poses => "poses",
        Effect::Temperature => "temperature",
        Effect::Absorption => "absorption",
    }
}

impl FromStr for EffectSwitch {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, setting) = text.split_once('=').unwrap_or((text, ""));
        let name = name.trim().replace('_', "-");
        let effect = Effect::ALL.into_iter().find(|effect| option_name(*effect) == name);
        if effect.is_none() && name != "all" {
            let known = Effect::ALL.map(option_name).join(", ");
            return Err(format!("no effect `{name}`; expected all or one of {known}"));
        }
        let setting = match setting.trim() {
            "auto" => EffectOverride::Auto,
            "on" => EffectOverride::On,
            "off" => EffectOverride::Off,
            _ => return Err(format!("expected `{name}=auto`, `{name}=on` or `{name}=off`")),
        };
        Ok(Self { effect, setting })
    }
}

/// The settings of an effect that a command allows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum AllowedSetting {
    /// The command always computes the effect.
    AlwaysOn,
    /// The command never computes the effect.
    AlwaysOff,
    /// The command computes the effect unless it is switched off.
    OnUnlessOff,
    /// The effect does not concern the command, which can neither compute it nor omit it.
    NotApplicable,
}

/// The rule of a command for an effect that it does not leave to the plan.
#[derive(Debug, Clone, Copy)]
pub(super) struct EffectRule {
    pub(super) effect: Effect,
    pub(super) allowed: AllowedSetting,
    /// The reason, as a clause.
    pub(super) reason: &'static str,
}

/// The rule of every command for total reflection.
const REFLECTION: EffectRule = EffectRule {
    effect: Effect::TotalReflection,
    allowed: AllowedSetting::AlwaysOn,
    reason: "the test is part of refraction and costs nothing",
};

/// The rule of every command with effects for absorption.
const ABSORPTION: EffectRule = EffectRule {
    effect: Effect::Absorption,
    allowed: AllowedSetting::AlwaysOff,
    reason: "no number here is of the light that glasses absorb; `picture --coating` asks for it",
};

impl EffectRule {
    fn forbids(&self, setting: EffectOverride) -> bool {
        matches!(
            (self.allowed, setting),
            (AllowedSetting::AlwaysOn, EffectOverride::Off)
                | (AllowedSetting::AlwaysOff, EffectOverride::On)
                | (AllowedSetting::NotApplicable, EffectOverride::On | EffectOverride::Off)
        )
    }

    /// Refuses a setting that the command cannot follow.
    fn check(&self, setting: EffectOverride) -> Result<(), CliError> {
        if !self.forbids(setting) {
            return Ok(());
        }
        let (name, reason) = (option_name(self.effect), self.reason);
        let verb = if setting == EffectOverride::Off { "off" } else { "on" };
        let text = format!("--effects: {name} cannot be switched {verb} here: {reason}");
        Err(CliError::Input(text))
    }

    /// The setting that is planned for the user's one.
    fn setting(&self, chosen: EffectOverride) -> EffectOverride {
        match (self.allowed, chosen) {
            (AllowedSetting::AlwaysOff | AllowedSetting::NotApplicable, _)
            | (AllowedSetting::OnUnlessOff, EffectOverride::Off) => EffectOverride::Off,
            _ => EffectOverride::On,
        }
    }

    /// Enters the rule into the decision that was planned.
    fn explain(&self, decision: &mut EffectDecision) {
        match self.allowed {
            AllowedSetting::AlwaysOff | AllowedSetting::NotApplicable => {
                (decision.needed, decision.residual) = (false, 0.0);
                self.reason.clone_into(&mut decision.reason);
            }
            _ if decision.computed => {
                decision.reason = format!("{}; {}", self.reason, decision.reason);
            }
            _ => {}
        }
    }
}

/// The user's settings within the rules of a command.
#[derive(Debug, Clone)]
pub(super) struct EffectChoices {
    chosen: EffectOverrides,
    rules: Vec<EffectRule>,
}

impl EffectArgs {
    /// The settings of the user for a command with these rules; an error names a switch that the
    /// command cannot follow.
    pub(super) fn choices(&self, rules: &[EffectRule]) -> Result<EffectChoices, CliError> {
        let rules: Vec<EffectRule> =
            rules.iter().copied().chain([REFLECTION, ABSORPTION]).collect();
        let rule_of = |effect| rules.iter().find(|rule| rule.effect == effect);
        let mut chosen = EffectOverrides::default();
        for switch in self.effects.iter().filter(|switch| switch.effect.is_none()) {
            let allowed = |e: &Effect| !rule_of(*e).is_some_and(|r| r.forbids(switch.setting));
            Effect::ALL.into_iter().filter(allowed).for_each(|e| chosen.set(e, switch.setting));
        }
        let named = self.effects.iter().filter_map(|switch| Some((switch.effect?, switch)));
        for (i, (effect, EffectSwitch { setting, .. })) in named.clone().enumerate() {
            if named.clone().take(i).any(|(other, _)| other == effect) {
                let text = format!("--effects: {} is switched twice", option_name(effect));
                return Err(CliError::Input(text));
            }
            rule_of(effect).map_or(Ok(()), |rule| rule.check(*setting))?;
            chosen.set(effect, *setting);
        }
        Ok(EffectChoices { chosen, rules })
    }
}

impl EffectChoices {
    /// The settings that are planned: those of the user within the rules.
    pub(super) fn overrides(&self) -> EffectOverrides {
        let planned = |overrides: EffectOverrides, rule: &EffectRule| {
            let setting = rule.setting(self.chosen.get(rule.effect));
            overrides.with(rule.effect, setting)
        };
        self.rules.iter().fold(self.chosen.clone(), planned)
    }

    /// True if an effect is switched off that the command computes otherwise.
    pub(super) fn leave_out_any(&self) -> bool {
        let never = [AllowedSetting::AlwaysOff, AllowedSetting::NotApplicable];
        Effect::ALL.into_iter().any(|effect| {
            let mut rules = self.rules.iter().filter(|rule| rule.effect == effect);
            let is_never = rules.any(|rule| never.contains(&rule.allowed));
            self.chosen.get(effect) == EffectOverride::Off && !is_never
        })
    }

    /// The plan for a purpose, from the measurements of a lens.
    pub(super) fn plan(&self, measured: &EffectMeasurements, purpose: TracePurpose) -> EffectPlan {
        let mut plan = effects::plan(measured, purpose, &self.overrides());
        self.explain(&mut plan.decisions);
        plan
    }

    /// Enters the user's settings and the rules of the command into the decisions of a plan.
    pub(super) fn explain(&self, decisions: &mut [EffectDecision]) {
        for decision in decisions {
            decision.choice = self.chosen.get(decision.effect);
            let rule = self.rules.iter().find(|rule| rule.effect == decision.effect);
            rule.into_iter().for_each(|rule| rule.explain(decision));
        }
    }
}

/// The rules of commands that change the lens.
const DESIGN_RULES: [EffectRule; 8] = [
    EffectRule {
        effect: Effect::Dispersion,
        allowed: AllowedSetting::OnUnlessOff,
        reason: "a lens that changes may need it at any step",
    },
    EffectRule {
        effect: Effect::Asphere,
        allowed: AllowedSetting::AlwaysOn,
        reason: "the aspheric terms are numbers of the lens that is changed",
    },
    EffectRule {
        effect: Effect::Clipping,
        allowed: AllowedSetting::AlwaysOn,
        reason: "the pupils that the merit function follows end at the semi-diameters",
    },
    EffectRule {
        effect: Effect::Aiming,
        allowed: AllowedSetting::AlwaysOn,
        reason: "the merit function fills the real stop",
    },
    EffectRule {
        effect: Effect::FiniteObject,
        allowed: AllowedSetting::AlwaysOn,
        reason: "the merit function is that of the object where it is",
    },
    EffectRule {
        effect: Effect::GradientIndex,
        allowed: AllowedSetting::AlwaysOn,
        reason: "its coefficients are numbers of the lens that is changed",
    },
    EffectRule {
        effect: Effect::Poses,
        allowed: AllowedSetting::AlwaysOn,
        reason: "tilts and decentres are numbers of the lens that is changed",
    },
    EffectRule {
        effect: Effect::Temperature,
        allowed: AllowedSetting::AlwaysOn,
        reason: "the merit function is that of the lens at its temperature",
    },
];

/// The effects of a command that changes the lens, which leaves none to the plan: the plan of a
/// lens says nothing about the next one.
#[derive(Debug)]
pub(super) struct DesignEffects(EffectChoices);

impl DesignEffects {
    /// The user's settings; an error names a switch that the command cannot follow.
    pub(super) fn new(args: &EffectArgs) -> Result<Self, CliError> {
        args.choices(&DESIGN_RULES).map(Self)
    }

    /// The same for a lens that the command itself reduces to one wavelength.
    pub(super) fn at_one_wavelength(
        args: &EffectArgs,
        reason: &'static str,
    ) -> Result<Self, CliError> {
        let mut rules = DESIGN_RULES;
        let allowed = AllowedSetting::AlwaysOff;
        rules[0] = EffectRule { effect: Effect::Dispersion, allowed, reason };
        args.choices(&rules).map(Self)
    }

    /// The lens that the command works with: at its primary wavelength alone without dispersion.
    pub(super) fn working_lens(&self, lens: &Lens) -> Lens {
        if self.0.overrides().get(Effect::Dispersion) != EffectOverride::Off {
            return lens.clone();
        }
        let primary = Wavelength { weight: 1.0, primary: true, ..lens.wavelengths[lens.primary()] };
        Lens { wavelengths: vec![primary], ..lens.clone() }
    }

    /// The report of the effects, with the numbers of the lens at the start: for each effect those
    /// of the zoom position where it matters most.
    pub(super) fn report(&self, lens: &Lens, file: &str) -> Result<EffectReport, CliError> {
        let refuse = |source| CliError::RayModel { file: file.to_owned(), source };
        let mut worst: Vec<EffectDecision> = Vec::new();
        for zoom in 0..lens.zoom_positions() {
            let measured = effects::measure_effects(lens, zoom).map_err(refuse)?;
            let plan = self.0.plan(&measured, TracePurpose::Exact);
            if worst.is_empty() {
                worst = plan.decisions;
                continue;
            }
            for (worst, decision) in worst.iter_mut().zip(plan.decisions) {
                if decision.error > worst.error {
                    *worst = decision;
                }
            }
        }
        Ok(EffectReport::uncounted(worst))
    }
}

/// The effects of a result, as it is printed.
#[derive(Debug, Clone, Serialize)]
pub(super) struct EffectReport {
    effects: Vec<EffectDecision>,
    /// The effects that were left out although they matter, and that no stated error counts.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    not_counted: Vec<Effect>,
}

impl EffectReport {
    /// The report of numbers whose errors count the shifts of rays by what is left out.
    pub(super) fn counted(plan: EffectPlan) -> Self {
        Self { not_counted: plan.unmeasured().collect(), effects: plan.decisions }
    }

    /// The report of numbers whose errors count nothing of what is left out.
    pub(super) fn uncounted(decisions: Vec<EffectDecision>) -> Self {
        let matters = |decision: &&EffectDecision| {
            decision.choice == EffectOverride::Off && (decision.needed || decision.residual > 0.0)
        };
        let not_counted = decisions.iter().filter(matters).map(|decision| decision.effect);
        Self { not_counted: not_counted.collect(), effects: decisions }
    }

    /// The line that says what no error counts; empty if there is nothing.
    fn warning(&self) -> String {
        if self.not_counted.is_empty() {
            return String::new();
        }
        let names: Vec<&str> = self.not_counted.iter().map(|effect| effect.name()).collect();
        format!("switched off, and not counted in the errors: {}", names.join(", "))
    }
}

impl Display for EffectReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let computed = self.effects.iter().filter(|decision| decision.computed);
        let names: Vec<&str> = computed.map(|decision| option_name(decision.effect)).collect();
        let computed = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
        let omitted = self.effects.len() - names.len();
        writeln!(
            f,
            "effects: {computed} computed; {omitted} omitted (`aplanat info` and --json say why)"
        )?;
        let warning = self.warning();
        if warning.is_empty() { Ok(()) } else { writeln!(f, "  {warning}") }
    }
}

/// A decision as a line of text.
pub(super) fn decision_text(decision: &EffectDecision) -> String {
    let EffectDecision { effect, choice, computed, reason, error, limit, unit, cost, .. } =
        decision;
    let verdict = if *computed { "computed" } else { "omitted" };
    let asked = match choice {
        EffectOverride::Auto => "",
        EffectOverride::On => "switched on: ",
        EffectOverride::Off => "switched off: ",
    };
    let saving = if *computed { "without it" } else { "saves" };
    let error =
        if error.is_finite() { ShortNumber(*error).to_string() } else { "unknown".to_owned() };
    let numbers = match *limit {
        0.0 => format!("{error} {unit}, none is allowed"),
        limit if limit.is_finite() => format!("{error} of {} {unit}", ShortNumber(limit)),
        _ => format!("{error} {unit}, any is allowed"),
    };
    let time = cost.map_or_else(String::new, |cost| {
        let (share, ms, error) = (100.0 * cost.saved_share, cost.saved_ms, cost.error_ms);
        format!("; {saving} {share:.0} %, {ms:.2} ± {error:.2} ms")
    });
    format!("  {:<18} {verdict:<8}  {asked}{reason} ({numbers}{time})", effect.name())
}

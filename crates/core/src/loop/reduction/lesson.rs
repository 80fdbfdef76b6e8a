//! What a frame teaches.

use super::HysteresisReduction;
use super::look::Seen;
use crate::article::estimator::Triggers;
use crate::dof::PerDof;
use crate::r#loop::history::Entry;
use crate::supervision::flags::{Flag, Flags};

impl HysteresisReduction {
    /// The slack from a frame that is believed; what is to be said of it is raised.
    pub(super) fn learn(
        &mut self,
        past: &Entry,
        seen: &Seen,
        raised: &mut Flags,
    ) -> PerDof<Triggers> {
        let mut triggers = [Triggers::default(); 3];
        let mut changes = [[0.0; 2]; 3];
        let flags = self.watch(past, seen);
        *raised = raised.union(flags);
        let history = &self.history;
        let outputs = seen.output.iter().zip(seen.output_deviation);
        let signals = seen
            .estimate
            .observable
            .iter()
            .zip(past.command)
            .zip(outputs);
        let axes = self
            .axes
            .iter_mut()
            .zip(triggers.iter_mut().zip(&mut changes))
            .zip(&mut self.corrected)
            .enumerate();
        for (
            (dof, ((axis, (triggers, change)), corrected)),
            ((observable, command), (output, deviation)),
        ) in axes.zip(signals)
        {
            if *observable {
                let since = history
                    .since(past.time)
                    .filter_map(|entry| entry.command.get(dof).copied());
                let before = axis.predicted_state();
                let lesson = axis.learn(command, *output, deviation, since);
                (*triggers, *change) = (lesson.triggers, lesson.change);
                *raised = raised.union(Flags::when(lesson.is_limited, Flag::WidthLimit));
                let moved = axis.predicted_state() - before;
                *corrected += if moved.is_finite() { moved } else { 0.0 };
            }
        }
        *raised = raised.union(self.monitors.taught(changes, past.travel));
        triggers
    }

    /// What the image says of hand and tip.
    fn watch(&mut self, past: &Entry, seen: &Seen) -> Flags {
        let play = self.play();
        self.monitors
            .look(past.time, past.reference, seen.image_state(), play)
    }
}
